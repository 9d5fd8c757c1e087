// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace maplet {

/// What became of something that was offered.
enum class Insert : std::uint8_t {
  kNew,
  kDuplicate,
  kFull,  ///< no room to remember it: refuse the record too, it will come again
};

/// Sequence numbers [first, end).
struct SeqRange {
  std::uint32_t first = 0;
  std::uint32_t end = 0;

  friend bool operator==(const SeqRange&, const SeqRange&) = default;
};

/// Which records of one stream are held: everything below next(), and a few islands above.
///
/// A number that would need one island more than there is room for is refused. That loses nothing:
/// records are asked for in order, so the gaps close from below.
///
/// Memory   fixed: kIslands ranges in the object.
/// Time     O(kIslands).
class SeqSet {
 public:
  static constexpr std::size_t kIslands = 8;
  /// Numbers from here on do not exist: an origin that used them up begins a new epoch.
  static constexpr std::uint32_t kSeqEnd = 0xFFFFFFFF;

  Insert insert(std::uint32_t seq) noexcept {
    if (seq >= kSeqEnd) return Insert::kFull;
    if (contains(seq)) return Insert::kDuplicate;
    if (seq == next_) {
      ++next_;
      if (count_ > 0 && islands_[0].first == next_) {
        next_ = islands_[0].end;
        erase(0);
      }
      return Insert::kNew;
    }
    std::size_t above = 0;
    while (above < count_ && islands_[above].first < seq) ++above;
    const bool joins_above = above < count_ && islands_[above].first == seq + 1;
    const bool joins_below = above > 0 && islands_[above - 1].end == seq;
    if (joins_above && joins_below) {
      islands_[above - 1].end = islands_[above].end;
      erase(above);
    } else if (joins_above) {
      islands_[above].first = seq;
    } else if (joins_below) {
      islands_[above - 1].end = seq + 1;
    } else if (count_ == kIslands) {
      return Insert::kFull;
    } else {
      std::copy_backward(islands_.begin() + above, islands_.begin() + count_,
                         islands_.begin() + count_ + 1);
      islands_[above] = {seq, seq + 1};
      ++count_;
    }
    return Insert::kNew;
  }

  [[nodiscard]] bool contains(std::uint32_t seq) const noexcept {
    return seq < next_ || std::ranges::any_of(islands(), [seq](const SeqRange& range) {
             return seq >= range.first && seq < range.end;
           });
  }
  /// Everything below is held, this is not.
  [[nodiscard]] std::uint32_t next() const noexcept { return next_; }
  /// Nothing from here on is held.
  [[nodiscard]] std::uint32_t end() const noexcept {
    return count_ == 0 ? next_ : islands_[count_ - 1].end;
  }
  [[nodiscard]] std::span<const SeqRange> islands() const noexcept {
    return {islands_.data(), count_};
  }

  /// Calls `take(SeqRange)` for what is not held of `range`, from below.
  template <class Take>
  void missing(SeqRange range, Take&& take) const {
    std::uint32_t at = std::max(range.first, next_);
    for (const SeqRange& island : islands()) {
      if (at >= range.end) return;
      if (at < island.first) take(SeqRange{at, std::min(island.first, range.end)});
      at = std::max(at, island.end);
    }
    if (at < range.end) take(SeqRange{at, range.end});
  }

  /// Calls `take(SeqRange)` for what is held, from below.
  template <class Take>
  void held(Take&& take) const {
    if (next_ > 0) take(SeqRange{0, next_});
    for (const SeqRange& island : islands()) take(island);
  }

  friend bool operator==(const SeqSet&, const SeqSet&) = default;

 private:
  void erase(std::size_t at) noexcept {
    std::copy(islands_.begin() + at + 1, islands_.begin() + count_, islands_.begin() + at);
    islands_[--count_] = {};
  }

  // An array, not a StaticVector: an arena takes only what needs no destructor.
  std::uint32_t next_ = 0;
  std::size_t count_ = 0;
  std::array<SeqRange, kIslands> islands_{};  ///< sorted, apart from each other and from next_
};

}  // namespace maplet
