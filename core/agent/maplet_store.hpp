// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "core/base/arena.hpp"
#include "core/maplet/maplet.hpp"

namespace maplet {

/// Encoded maplets of one agent, the newest `slots` of them.
///
/// Memory   slots x slot_bytes in the arena.
/// Time     O(1).
class MapletStore {
 public:
  MapletStore(std::size_t slots, std::size_t slot_bytes, Arena& arena);

  /// Keeps a copy. Beyond the capacity the oldest goes.
  /// @param bytes  at most slot_bytes, or it is a bug
  void put(std::uint32_t id, std::span<const std::byte> bytes) noexcept;

  /// The encoded maplet, or nothing when it was never put or is gone.
  [[nodiscard]] std::optional<std::span<const std::byte>> find(std::uint32_t id) const noexcept;

  [[nodiscard]] std::uint64_t forgotten() const noexcept { return forgotten_; }

 private:
  struct Slot {
    std::uint32_t id = 0;
    std::uint32_t bytes = 0;  ///< 0 = empty
  };
  [[nodiscard]] std::span<std::byte> storage(std::size_t slot) const noexcept {
    return bytes_.subspan(slot * slot_bytes_, slot_bytes_);
  }

  std::size_t slot_bytes_;
  std::span<Slot> slots_;
  std::span<std::byte> bytes_;
  std::uint64_t forgotten_ = 0;
};

}  // namespace maplet
