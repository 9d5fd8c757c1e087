// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/base/clock.hpp"
#include "transport/security/replay_window.hpp"

namespace maplet {

/// One start of another agent, as its frames say it.
struct Session {
  enum class State : std::uint8_t {
    kUnproven,  ///< its frames are of our team, but may have been said long ago
    kProven,    ///< it answered a question that we asked since
    kEnded,     ///< the agent started again
  };

  std::uint64_t id = 0;
  std::uint16_t agent = 0;
  State state = State::kUnproven;
  ReplayWindow window;
  std::uint32_t waiting = 0;  ///< of its frames that came before the proof
  Instant heard{};
  Instant ask_at{};  ///< unproven: when it is asked (again)
  Duration patience{};
  int questions = 0;  ///< that it was asked in one go
  bool asks = false;  ///< it wants a proof of us
  std::uint64_t challenge = 0;
  Instant answer_at{};
  int answers = 0;  ///< given since it was proven
};

/// Everybody heard since the start.
///
/// Memory   a fixed table in the arena. A new session takes the place of the unproven or ended one
///   that was silent for longest, else of such a proven one, which then proves itself anew.
/// Time     O(sessions). Threads one.
class Sessions {
 public:
  Sessions(std::size_t capacity, Arena& arena)
      : places_{arena.make_array<Session>(capacity, "security/sessions")} {}

  [[nodiscard]] Session* find(std::uint16_t agent, std::uint64_t id) noexcept;
  Session& add(std::uint16_t agent, std::uint64_t id, Instant now) noexcept;
  /// Its earlier sessions are over.
  void prove(Session& session, std::uint32_t counter) noexcept;
  void end_all_of(std::uint16_t agent) noexcept;

  [[nodiscard]] std::span<Session> all() noexcept { return places_.first(count_); }
  [[nodiscard]] std::span<const Session> all() const noexcept { return places_.first(count_); }

 private:
  std::span<Session> places_;
  std::size_t count_ = 0;
};

}  // namespace maplet
