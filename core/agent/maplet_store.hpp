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

/// Encoded maplets in a ring of bytes, the newest `slots` of them if they have kExpectedBytes on
/// average, else as many of the newest as fit; and the region that one's frontier proposes to
/// registration.
///
/// Memory   slots x (kExpectedBytes, or max_bytes if less, + ~350 bytes) in the arena.
/// Time     find: O(1) for one agent's maplets kept in order of their ids from 0, else O(slots).
class MapletStore {
 public:
  static constexpr std::size_t kExpectedBytes = 4096;

  /// @param max_bytes               of one maplet
  /// @param slots_name, bytes_name  literals for the memory ledger
  MapletStore(std::size_t slots, std::size_t max_bytes, Arena& arena,
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
  [[nodiscard]] std::uint64_t forgotten() const noexcept { return forgotten_; }

 private:
  struct Slot {
    MapletKey key;
    std::uint32_t at = 0;     ///< in bytes_
    std::uint32_t bytes = 0;  ///< 0 = empty
    RegionOfInterest frontier;
  };
  [[nodiscard]] std::optional<std::size_t> slot_of(const MapletKey& key) const noexcept;
  /// Forgets the oldest ones until `size` bytes are free at next_.
  void make_room(std::size_t size) noexcept;
  void forget_oldest() noexcept { slots_[forgotten_++ % slots_.size()].bytes = 0; }
  [[nodiscard]] bool oldest_begins_in(std::size_t from, std::size_t to) const noexcept;

  std::size_t max_bytes_;
  std::span<Slot> slots_;
  std::span<std::byte> bytes_;
  std::size_t next_ = 0;  ///< in bytes_: where the next one goes
  std::uint64_t count_ = 0;
  std::uint64_t forgotten_ = 0;
};

}  // namespace maplet
