// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/security/sessions.hpp"

#include <algorithm>
#include <utility>

namespace maplet {

Session* Sessions::find(std::uint16_t agent, std::uint64_t id) noexcept {
  for (Session& session : all()) {
    if (session.id == id && session.agent == agent) return &session;
  }
  return nullptr;
}

Session& Sessions::add(std::uint16_t agent, std::uint64_t id, Instant now) noexcept {
  Session* place = nullptr;
  if (count_ < places_.size()) {
    place = &places_[count_++];
  } else {
    const auto worth = [](const Session& session) {
      return std::pair{session.state == Session::State::kProven, session.heard};
    };
    place = &*std::ranges::min_element(places_, {}, worth);
  }
  *place = Session{};
  place->id = id;
  place->agent = agent;
  place->heard = now;
  return *place;
}

void Sessions::prove(Session& session, std::uint32_t counter) noexcept {
  end_all_of(session.agent);
  session.state = Session::State::kProven;
  session.window = ReplayWindow{counter};
  session.waiting = 0;
  session.answers = 0;
}

void Sessions::end_all_of(std::uint16_t agent) noexcept {
  for (Session& session : all()) {
    if (session.agent == agent && session.state == Session::State::kProven) {
      session.state = Session::State::kEnded;
      session.asks = false;
    }
  }
}

}  // namespace maplet
