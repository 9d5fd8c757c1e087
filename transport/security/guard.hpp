// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <string_view>
#include <utility>

#include "core/base/arena.hpp"
#include "core/base/clock.hpp"
#include "transport/security/frame.hpp"
#include "transport/security/notice_board.hpp"
#include "transport/security/sessions.hpp"

namespace maplet {

/// Why a frame was not believed.
enum class Refusal : std::uint8_t {
  kPlain,     ///< not sealed at all: an agent without keys
  kForeign,   ///< sealed with a key that we do not have
  kTampered,  ///< of somebody we know, but changed on the way; or no frame at all
  kReplayed,  ///< said once already
  kUnproven,  ///< of our team, but perhaps long ago: nobody stands behind it yet
  kOldKey,    ///< sealed with a key of an earlier generation
  kRevoked,   ///< the same, by an agent whose keys were revoked
  kNewerKey,  ///< sealed with a key of a later generation, which we wait for
  kNoKeys,    ///< our own keys are expired, not valid yet or revoked: we believe nobody
  kNotice,    ///< a word about keys that the operator did not sign
};
inline constexpr std::size_t kRefusals = 10;
[[nodiscard]] std::string_view to_string(Refusal refusal) noexcept;

struct GuardCounters {
  std::array<std::uint64_t, kRefusals> refused{};
  std::uint64_t sealed = 0;
  std::uint64_t opened = 0;
  std::uint64_t talk_sent = 0;
  int last_agent = -1;  ///< who the newest refused frame says it is; -1: it does not say

  [[nodiscard]] std::uint64_t of(Refusal refusal) const noexcept {
    return refused[static_cast<std::size_t>(refusal)];
  }
  [[nodiscard]] std::uint64_t all_refused() const noexcept;
};

/// Stands between the exchange and the link of a secured agent: seals what goes out, and lets in
/// only what a member of the team said now. Plain frames neither go out nor come in, whatever
/// happens.
///
/// A frame is believed when it opens with the group's present key, when its session has proven that
/// it is of now (it answered a challenge that we drew after we first heard it), and when its
/// counter was not seen before. Nothing needs to be remembered over a restart, and no clock is
/// believed but for the keys' dates.
///
/// Memory   the arena, at construction; none on the way of a frame. A notice that is new takes some
///   of the heap to verify.
/// Time     a microsecond a frame. Threads one at a time.
/// Math     docs/security.md.
class Guard {
 public:
  struct Config {
    std::int64_t clock_tolerance_s = 300;
    Duration quick{};  ///< LinkProfile::quick: patience follows the link
    std::size_t sessions = 256;
    std::uint32_t last_counter = kLastCounter;  ///< of a session
  };
  enum class State : std::uint8_t { kGood, kNotYet, kExpired, kRevoked };

  Guard(const Config& config, const AgentKeys& keys, Arena& arena);

  /// Of the machine; looked at for the keys' dates only.
  void set_wall_clock(std::int64_t now_s) noexcept { now_s_ = now_s; }
  [[nodiscard]] State state() const noexcept;

  /// @return the frame that goes out; empty while our keys are of no use. Valid until the next call
  [[nodiscard]] std::span<const std::byte> seal(std::span<const std::byte> datagram) noexcept;
  /// @param frame  anything at all
  /// @return the datagram inside; empty: refused, or nothing for the exchange. Valid until the next
  ///   call
  [[nodiscard]] std::span<const std::byte> open(std::span<const std::byte> frame,
                                                Instant now) noexcept;
  /// What the guard itself has to say. Call it when the link has room. @return empty: nothing
  [[nodiscard]] std::span<const std::byte> next(Instant now) noexcept;
  [[nodiscard]] Instant due() const noexcept;
  /// Whether somebody was let in since the last call: what was said before was for nobody.
  [[nodiscard]] bool let_in() noexcept { return std::exchange(let_in_, false); }

  enum class Taken : std::uint8_t {
    kNew,      ///< new keys, or a part of what others need
    kKnown,    ///< that is known
    kOld,      ///< of an earlier generation
    kNoSense,  ///< no notice
    kForeign,  ///< of another team
    kForged,   ///< not signed by the operator
  };
  /// A notice from anybody.
  Taken take_notice(std::span<const std::byte> bytes, Instant now) noexcept;

  [[nodiscard]] const AgentKeys& keys() const noexcept { return keys_; }
  [[nodiscard]] const NoticeBoard& board() const noexcept { return board_; }
  [[nodiscard]] const Sessions& sessions() const noexcept { return sessions_; }
  [[nodiscard]] const GuardCounters& counters() const noexcept { return counters_; }

 private:
  void refuse(Refusal why, int agent) noexcept;
  [[nodiscard]] bool current(const FrameHead& head, Instant now) noexcept;
  [[nodiscard]] std::span<const std::byte> open_sealed(std::span<const std::byte> frame,
                                                       const FrameHead& head, Instant now) noexcept;
  void hear_notice(std::span<const std::byte> bytes, Instant now) noexcept;
  void hear_talk(std::span<const std::byte> text, const FrameHead& head, Session& session,
                 Instant now) noexcept;
  void ask(Session& session, Instant now) noexcept;
  [[nodiscard]] std::span<const std::byte> write_talk(Instant now) noexcept;
  [[nodiscard]] std::span<const std::byte> seal_text(FrameKind kind,
                                                     std::span<const std::byte> text) noexcept;
  void take_key() noexcept;
  void start_session() noexcept;
  [[nodiscard]] std::uint32_t newest_generation() const noexcept {
    return std::max(board_.generation(), keys_.generation);
  }
  [[nodiscard]] bool is_revoked(std::uint16_t agent) const noexcept;
  [[nodiscard]] Duration jitter(Duration most) noexcept;

  Config config_;
  AgentKeys keys_;
  Aead aead_;
  Sessions sessions_;
  NoticeBoard board_;
  std::int64_t now_s_;
  std::uint64_t session_ = 0;
  std::uint32_t counter_ = 0;
  std::uint64_t challenge_ = 0;
  std::uint64_t earlier_challenge_ = 0;
  Instant challenge_at_{};
  Instant verified_at_{};
  std::uint64_t random_ = 1;
  bool let_in_ = false;
  GuardCounters counters_;
  std::array<std::byte, kMaxDatagramBytes> out_{};
  std::array<std::byte, kMaxDatagramBytes> in_{};
};

}  // namespace maplet
