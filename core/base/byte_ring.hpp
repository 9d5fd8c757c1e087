// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <utility>

#include "core/base/arena.hpp"

namespace maplet {

/// Blobs (encoded maplets) in a ring of bytes, each with a key and a note: the newest `slots` of
/// them if they have the expected bytes on average, else as many of the newest as fit.
///
/// Memory   slots x (expected_bytes, or max_bytes if less, + ~24 bytes + a note) in the arena.
/// Time     find: O(1) for keys kept in order of their `id` from 0, else O(slots).
/// Threads  one
template <class Key, class Note>
class ByteRing {
 public:
  struct Slot {
    Key key;
    std::uint32_t at = 0;
    std::uint32_t bytes = 0;  ///< 0 = empty
    Note note{};
  };

  /// @param expected_bytes          of a blob, on average
  /// @param max_bytes               of one blob
  /// @param slots_name, bytes_name  literals for the memory ledger
  ByteRing(std::size_t slots, std::size_t expected_bytes, std::size_t max_bytes, Arena& arena,
           std::string_view slots_name, std::string_view bytes_name)
      : max_bytes_{max_bytes},
        slots_{arena.make_array<Slot>(slots, slots_name)},
        bytes_{arena.make_array<std::byte>(
            std::max(slots * std::min(max_bytes, expected_bytes), max_bytes), bytes_name)} {}

  /// Keeps a copy. Beyond the capacity the oldest goes.
  /// @return false: known, or too large
  bool put(const Key& key, std::span<const std::byte> bytes, const Note& note = {}) noexcept {
    if (bytes.empty() || bytes.size() > max_bytes_ || find(key) != nullptr) return false;
    make_room(bytes.size());
    slots_[slot_of(count_++)] = {key, static_cast<std::uint32_t>(next_),
                                 static_cast<std::uint32_t>(bytes.size()), note};
    std::ranges::copy(bytes, bytes_.subspan(next_).begin());
    next_ += bytes.size();
    return true;
  }

  [[nodiscard]] const Slot* find(const Key& key) const noexcept {
    const auto holds = [&](const Slot& slot) { return slot.bytes != 0 && slot.key == key; };
    const Slot& likely = slots_[slot_of(key.id)];
    if (holds(likely)) return &likely;
    const auto found = std::ranges::find_if(slots_, holds);
    return found == slots_.end() ? nullptr : &*found;
  }
  [[nodiscard]] Slot* find(const Key& key) noexcept {
    return const_cast<Slot*>(std::as_const(*this).find(key));
  }
  /// The nth that was ever kept, forgotten() <= n < count().
  [[nodiscard]] const Slot& nth(std::uint64_t n) const noexcept { return slots_[slot_of(n)]; }
  [[nodiscard]] std::span<const std::byte> bytes(const Slot& slot) const noexcept {
    return bytes_.subspan(slot.at, slot.bytes);
  }

  /// Ever kept; and of these, gone.
  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
  [[nodiscard]] std::uint64_t forgotten() const noexcept { return forgotten_; }

 private:
  [[nodiscard]] std::size_t slot_of(std::uint64_t n) const noexcept {
    return static_cast<std::size_t>(n % slots_.size());
  }
  /// Forgets the oldest ones until `size` bytes are free at next_.
  void make_room(std::size_t size) noexcept {
    if (count_ - forgotten_ == slots_.size()) forget_oldest();
    if (next_ + size > bytes_.size()) {  // what lies behind is of the last lap, the oldest
      while (oldest_begins_in(next_, bytes_.size())) forget_oldest();
      next_ = 0;
    }
    while (oldest_begins_in(next_, next_ + size)) forget_oldest();
  }
  void forget_oldest() noexcept { slots_[slot_of(forgotten_++)].bytes = 0; }
  [[nodiscard]] bool oldest_begins_in(std::size_t from, std::size_t to) const noexcept {
    if (forgotten_ == count_) return false;
    const std::size_t at = slots_[slot_of(forgotten_)].at;
    return at >= from && at < to;
  }

  std::size_t max_bytes_;
  std::span<Slot> slots_;
  std::span<std::byte> bytes_;
  std::size_t next_ = 0;  ///< in bytes_: where the next one goes
  std::uint64_t count_ = 0;
  std::uint64_t forgotten_ = 0;
};

}  // namespace maplet
