// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "core/base/arena.hpp"
#include "core/maplet/maplet.hpp"
#include "core/registration/region.hpp"

namespace maplet {

/// Encoded maplets, the newest `slots` of them, and the region that one's frontier proposes to
/// registration.
///
/// Memory   slots x (slot_bytes + ~350 bytes) in the arena.
/// Time     find: O(1) for one agent's maplets kept in order of their ids from 0, else O(slots).
class MapletStore {
 public:
  /// @param slots_name, bytes_name  literals for the memory ledger
  MapletStore(std::size_t slots, std::size_t slot_bytes, Arena& arena,
              std::string_view slots_name = "agent/maplet slots",
              std::string_view bytes_name = "agent/own maplets");

  /// Keeps a copy. Beyond the capacity the oldest goes.
  /// @return false: known, or too large
  bool put(const MapletKey& key, std::span<const std::byte> bytes) noexcept;
  /// Of a maplet that is kept.
  void set_frontier(const MapletKey& key, const RegionOfInterest& frontier) noexcept;

  /// The encoded maplet, or nothing when it was never put or is gone.
  [[nodiscard]] std::optional<std::span<const std::byte>> find(const MapletKey& key) const noexcept;
  /// Where its frontier is, its own frame; nullptr when none was set, or it is not kept.
  [[nodiscard]] const RegionOfInterest* frontier(const MapletKey& key) const noexcept;

  /// Ever kept; and of these, gone.
  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
  [[nodiscard]] std::uint64_t forgotten() const noexcept {
    return count_ > slots_.size() ? count_ - slots_.size() : 0;
  }

 private:
  struct Slot {
    MapletKey key;
    std::uint32_t bytes = 0;  ///< 0 = empty
    RegionOfInterest frontier;
  };
  [[nodiscard]] std::optional<std::size_t> slot_of(const MapletKey& key) const noexcept;
  [[nodiscard]] std::span<std::byte> storage(std::size_t slot) const noexcept {
    return bytes_.subspan(slot * slot_bytes_, slot_bytes_);
  }

  std::size_t slot_bytes_;
  std::span<Slot> slots_;
  std::span<std::byte> bytes_;
  std::uint64_t count_ = 0;
};

}  // namespace maplet
