// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "core/base/arena.hpp"
#include "core/maplet/maplet.hpp"

namespace maplet {

/// Encoded maplets of other agents, the newest `slots` of them.
///
/// Memory   slots x slot_bytes in the arena. Time O(slots).
class ForeignMaplets {
 public:
  ForeignMaplets(std::size_t slots, std::size_t slot_bytes, Arena& arena)
      : slot_bytes_{slot_bytes},
        slots_{arena.make_array<Slot>(slots, "agent/foreign slots")},
        bytes_{arena.make_array<std::byte>(slots * slot_bytes, "agent/foreign maplets")} {}

  /// Keeps a copy; beyond the capacity the oldest goes. @return false: known, or too large
  bool put(const MapletKey& key, std::span<const std::byte> bytes) noexcept {
    if (bytes.empty() || bytes.size() > slot_bytes_ || find(key)) return false;
    const std::size_t at = count_++ % slots_.size();
    slots_[at] = {key, static_cast<std::uint32_t>(bytes.size())};
    std::ranges::copy(bytes, storage(at).begin());
    return true;
  }
  [[nodiscard]] std::optional<std::span<const std::byte>> find(
      const MapletKey& key) const noexcept {
    for (std::size_t i = 0; i < std::min<std::uint64_t>(count_, slots_.size()); ++i) {
      if (slots_[i].key == key) return storage(i).first(slots_[i].bytes);
    }
    return {};
  }
  /// Ever kept.
  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }

 private:
  struct Slot {
    MapletKey key;
    std::uint32_t bytes = 0;
  };
  [[nodiscard]] std::span<std::byte> storage(std::size_t slot) const noexcept {
    return bytes_.subspan(slot * slot_bytes_, slot_bytes_);
  }

  std::size_t slot_bytes_;
  std::span<Slot> slots_;
  std::span<std::byte> bytes_;
  std::uint64_t count_ = 0;
};

}  // namespace maplet
