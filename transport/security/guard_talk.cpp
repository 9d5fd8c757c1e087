// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// How an agent finds out that another one speaks now: a challenge, drawn at random, to everybody
// unproven; whoever answers it made the answer after it was drawn.
//
// The text of a talk frame: u64 our challenge, 0 = none; then proofs: u16 agent, u64 its challenge.
#include <algorithm>

#include "transport/exchange/byte_io.hpp"
#include "transport/security/guard.hpp"

namespace maplet {

namespace {

constexpr Duration kSoon = std::chrono::milliseconds{50};
constexpr Duration kMostPatience = std::chrono::seconds{60};
constexpr Duration kChallengeAge = std::chrono::seconds{60};
constexpr std::size_t kMostProofs = 32;
constexpr int kEager = 3;  // questions and answers that are lost, before they become seldom

}  // namespace

void Guard::ask(Session& session, Instant now) noexcept {
  if (session.patience == Duration{}) {
    session.patience = config_.quick / 2;
    session.questions = 0;
    session.ask_at = now + kSoon + jitter(config_.quick / 8);
  } else if (session.ask_at == Instant::max()) {  // asked, and still unproven
    session.ask_at = now + session.patience;
    if (++session.questions >= kEager) {
      session.patience = std::min(2 * session.patience, kMostPatience);
    }
  }
}

void Guard::hear_talk(std::span<const std::byte> text, const FrameHead& head, Session& session,
                      Instant now) noexcept {
  ByteReader in{text};
  const std::uint64_t challenge = in.fixed(8);
  while (in.ok() && in.left() >= 10) {
    const auto agent = static_cast<std::uint16_t>(in.fixed(2));
    const std::uint64_t proof = in.fixed(8);
    const bool good = proof != 0 && (proof == challenge_ || (proof == earlier_challenge_ &&
                                                             now - challenge_at_ < kChallengeAge));
    if (agent != keys_.agent || !good || session.state == Session::State::kProven) continue;
    counters_.refused[static_cast<std::size_t>(Refusal::kUnproven)] -= session.waiting;
    sessions_.prove(session, head.counter);
    let_in_ = true;
  }
  if (challenge != 0 && (!session.asks || session.challenge != challenge)) {
    session.asks = true;
    session.challenge = challenge;
    session.answer_at = std::max(now + kSoon + jitter(config_.quick / 8), session.answer_at);
  }
  if (session.state == Session::State::kUnproven) ask(session, now);
}

std::span<const std::byte> Guard::write_talk(Instant now) noexcept {
  const auto is_due = [&](const Session& session) {
    return (session.asks && now >= session.answer_at) ||
           (session.state == Session::State::kUnproven && session.patience > Duration{} &&
            now >= session.ask_at);
  };
  if (std::ranges::none_of(sessions_.all(), is_due)) return {};
  std::array<std::byte, 8 + 10 * kMostProofs> text{};
  ByteWriter out{text};
  out.fixed(0, 8);
  bool asking = false;
  std::size_t proofs = 0;
  for (Session& session : sessions_.all()) {
    if (session.asks && proofs < kMostProofs) {
      out.fixed(session.agent, 2);
      out.fixed(session.challenge, 8);
      session.asks = false;
      const int seldom = std::max(0, session.answers - kEager);
      session.answer_at = now + config_.quick / 2 * (1 << seldom);  // not sooner again
      session.answers = std::min(session.answers + 1, kEager + 6);
      ++proofs;
    }
    if (session.state == Session::State::kUnproven && session.ask_at != Instant::max() &&
        session.patience > Duration{}) {
      asking = true;
      session.ask_at = Instant::max();  // until it is heard again
    }
  }
  if (asking) {
    if (challenge_ == 0 || now - challenge_at_ >= kChallengeAge) {
      earlier_challenge_ = challenge_;
      std::array<std::byte, 8> drawn{};
      fill_random(drawn);
      challenge_ = ByteReader{drawn}.fixed(8);
      challenge_at_ = now;
    }
    ByteWriter{std::span{text}.first(8)}.fixed(challenge_, 8);
  }
  ++counters_.talk_sent;
  return seal_text(FrameKind::kTalk, std::span{text}.first(out.size()));
}

Instant Guard::due() const noexcept {
  Instant due = board_.due();
  if (state() != State::kGood) return due;
  for (const Session& session : sessions_.all()) {
    if (session.asks) due = std::min(due, session.answer_at);
    const bool unproven = session.state == Session::State::kUnproven;
    if (unproven && session.patience > Duration{}) due = std::min(due, session.ask_at);
  }
  return due;
}

}  // namespace maplet
