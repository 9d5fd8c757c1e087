// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "core/base/arena.hpp"

namespace maplet {

/// The largest set of things that all agree with each other, two by two: a clique, found greedily
/// from every start and improved by exchange. Closures between two agents are such things: wrong
/// ones seldom agree with each other.
///
/// Memory   capacity^2 / 8 bytes, from the arena.
/// Time     find: O(count^3 / 64) at worst.
/// Math     docs/math/skeleton.md, section 8.
class ConsistentSet {
 public:
  ConsistentSet(int capacity, Arena& arena);

  [[nodiscard]] int capacity() const noexcept { return capacity_; }
  void clear(int count) noexcept;
  void agree(int i, int j) noexcept;
  [[nodiscard]] bool agrees(int i, int j) const noexcept {
    return ((row(i)[j / 64] >> (j % 64)) & 1U) != 0U;
  }
  /// Marks members. It is maximal: whoever is out disagrees with one that is in. Ties: lower
  /// numbers. @return how many
  int find(std::span<bool> member) noexcept;
  /// The largest such set of those alone that are no members.
  /// @return how many; 0: all are
  int find_apart_from(std::span<const bool> member) noexcept;

 private:
  [[nodiscard]] std::span<const std::uint64_t> row(int i) const noexcept {
    return bits_.subspan(static_cast<std::size_t>(i) * words_, words_);
  }
  [[nodiscard]] std::span<std::uint64_t> row(int i) noexcept {
    return bits_.subspan(static_cast<std::size_t>(i) * words_, words_);
  }
  int grow(int first) noexcept;

  int capacity_;
  std::size_t words_;
  std::span<std::uint64_t> bits_;
  std::span<std::uint64_t> candidates_;
  std::span<std::uint64_t> chosen_;
  std::span<std::uint64_t> best_;
  std::span<std::uint64_t> out_;  ///< never chosen
  int count_ = 0;
};

}  // namespace maplet
