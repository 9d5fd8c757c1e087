// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/base/clock.hpp"
#include "transport/security/key_notice.hpp"

namespace maplet {

/// The newest notice known, in its parts, and when it is passed on: at once when it is new, and
/// whenever somebody is heard who does not know it, first the part that this one needs. Bounded: no
/// more than a part in `pause`, which doubles while the same is said again and again.
///
/// Memory   the arena, kMaxParts notices. Threads one.
class NoticeBoard {
 public:
  NoticeBoard(Duration pause, Arena& arena);

  /// Takes a verified part. @return false: that was known, or is older
  bool put(const KeyNotice& notice, std::span<const std::byte> bytes, Instant now) noexcept;
  [[nodiscard]] std::uint32_t generation() const noexcept { return generation_; }
  [[nodiscard]] bool holds(std::uint32_t generation, std::uint8_t part) const noexcept;

  /// That agent, or somebody, does not know it.
  void wanted(std::uint16_t agent, Instant now) noexcept;
  /// The part to be said now. @return empty: none
  [[nodiscard]] std::span<const std::byte> next(Instant now) noexcept;
  [[nodiscard]] Instant due() const noexcept { return waiting_ == 0 ? Instant::max() : at_; }

  /// Part by part; parts that are not there are empty.
  [[nodiscard]] std::size_t parts() const noexcept { return parts_; }
  [[nodiscard]] std::span<const std::byte> part(std::size_t i) const noexcept {
    return std::span{places_[i].bytes}.first(places_[i].size);
  }
  [[nodiscard]] std::uint64_t sent() const noexcept { return sent_; }
  /// Grows when what is held changes: to be kept on disk.
  [[nodiscard]] std::uint64_t changes() const noexcept { return changes_; }

 private:
  struct Place {
    std::size_t size = 0;
    std::array<std::byte, kMaxNoticeBytes> bytes;
  };

  std::span<Place> places_;
  Duration pause_;
  Duration patience_;
  std::uint32_t generation_ = 0;
  std::size_t parts_ = 0;
  std::uint64_t waiting_ = 0;  ///< parts to be said: a bit each
  std::size_t first_ = 0;      ///< of these
  Instant at_{};
  Instant said_at_{};
  std::uint64_t sent_ = 0;
  std::uint64_t changes_ = 0;
};

}  // namespace maplet
