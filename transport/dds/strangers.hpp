// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

#include "core/base/clock.hpp"

namespace maplet {

/// Participants that DDS Security lets in on the link but not to our topics: without certificates,
/// with foreign or revoked ones. DDS tells nobody of them; they are those that are discovered and,
/// after a while that a handshake may take, still match nothing of ours.
///
/// Memory   fixed, and Cyclone's. Threads one.
class Strangers {
 public:
  /// @param reader  of a topic that every agent writes
  Strangers(std::int32_t participant, std::int32_t reader) noexcept;

  /// Looks who is there. Now and then.
  void look(Instant now) noexcept;
  /// Counted so far, each once.
  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }

 private:
  static constexpr std::size_t kMost = 64;
  struct Seen {
    std::uint64_t handle = 0;
    Instant first{};
    bool counted = false;
    bool there = false;
  };
  [[nodiscard]] Seen* find_or_add(std::uint64_t handle, Instant now) noexcept;

  std::int32_t reader_;
  std::int32_t participants_;
  std::uint64_t own_ = 0;
  std::array<Seen, kMost> seen_{};
  std::uint64_t count_ = 0;
};

}  // namespace maplet
