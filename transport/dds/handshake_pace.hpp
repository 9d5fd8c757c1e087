// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "core/base/clock.hpp"

namespace maplet {

/// The first 12 bytes of a participant's GUID.
using GuidPrefix = std::array<std::byte, 12>;

/// Whom an RTPS message introduces its sender to: what DDS Security says before a participant is
/// authenticated (ParticipantStatelessMessage). Nothing for all other messages.
/// @param head  the message's first bytes; 64 are enough
[[nodiscard]] std::optional<GuidPrefix> introduced_to(std::span<const std::byte> head) noexcept;

/// How often DDS Security may introduce us to one participant. It does so every second for as long
/// as there is no answer that it likes, with its certificates, 4 kB each time: one stranger would
/// take the budget of a slow link. The first times are free, then ever more seldom.
///
/// Memory   fixed. Time O(1). Threads one at a time.
class HandshakePace {
 public:
  static constexpr int kFree = 4;
  static constexpr Duration kMostPause = std::chrono::seconds{20};
  static constexpr std::size_t kMost = 64;  ///< participants remembered

  /// @return whether a datagram of an introduction may go now. Those of half a second go together.
  [[nodiscard]] bool allows(const GuidPrefix& to, Instant now) noexcept;

 private:
  struct Stranger {
    GuidPrefix prefix{};
    int times = 0;  ///< 0: a free place
    Instant last{};
    Instant next{};
  };
  [[nodiscard]] Stranger& find_or_add(const GuidPrefix& prefix) noexcept;

  std::array<Stranger, kMost> strangers_{};
};

}  // namespace maplet
