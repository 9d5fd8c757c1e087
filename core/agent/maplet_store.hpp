// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "core/base/arena.hpp"
#include "core/base/byte_ring.hpp"
#include "core/maplet/maplet.hpp"
#include "core/registration/region.hpp"

namespace maplet {

/// Encoded maplets, and the region that one's frontier proposes to registration.
///
/// Memory   as ByteRing, a slot has ~350 bytes
class MapletStore {
  struct Border {
    bool known = false;
    RegionOfInterest region;
  };
  using Ring = ByteRing<MapletKey, Border>;

 public:
  /// @param expected_bytes          of a maplet, on average
  /// @param max_bytes               of one maplet
  /// @param slots_name, bytes_name  literals for the memory ledger
  MapletStore(std::size_t slots, std::size_t expected_bytes, std::size_t max_bytes, Arena& arena,
              std::string_view slots_name = "agent/maplet slots",
              std::string_view bytes_name = "agent/own maplets")
      : ring_{slots, expected_bytes, max_bytes, arena, slots_name, bytes_name} {}

  /// Keeps a copy. Beyond the capacity the oldest goes.
  /// @return false: known, or too large
  bool put(const MapletKey& key, std::span<const std::byte> bytes) noexcept {
    return ring_.put(key, bytes);
  }
  /// Of a maplet that is kept.
  void set_frontier(const MapletKey& key, const RegionOfInterest& frontier) noexcept {
    if (auto* slot = ring_.find(key)) slot->note = {true, frontier};
  }

  /// The encoded maplet, or nothing when it was never put or is gone.
  [[nodiscard]] std::optional<std::span<const std::byte>> find(
      const MapletKey& key) const noexcept {
    const auto* slot = ring_.find(key);
    if (slot == nullptr) return {};
    return ring_.bytes(*slot);
  }
  /// Whether that was asked for, of a maplet that is kept: those of earlier runs are not looked at
  /// before they are compared with something.
  [[nodiscard]] bool knows_frontier(const MapletKey& key) const noexcept {
    const auto* slot = ring_.find(key);
    return slot != nullptr && slot->note.known;
  }
  /// Where its frontier is, its own frame; nullptr when it has none or is not known, or the maplet
  /// is not kept.
  [[nodiscard]] const RegionOfInterest* frontier(const MapletKey& key) const noexcept {
    const auto* slot = ring_.find(key);
    return slot != nullptr && !slot->note.region.corners.empty() ? &slot->note.region : nullptr;
  }

  /// The nth that was ever kept; nullptr when it is gone.
  [[nodiscard]] const MapletKey* nth(std::uint64_t n) const noexcept {
    return n >= ring_.forgotten() && n < ring_.count() ? &ring_.nth(n).key : nullptr;
  }
  /// Ever kept; and of these, gone.
  [[nodiscard]] std::uint64_t count() const noexcept { return ring_.count(); }
  [[nodiscard]] std::uint64_t forgotten() const noexcept { return ring_.forgotten(); }

 private:
  Ring ring_;
};

}  // namespace maplet
