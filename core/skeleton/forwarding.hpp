// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/skeleton/relation.hpp"

namespace maplet {

/// splitmix64.
[[nodiscard]] constexpr std::uint64_t hash_of(std::uint64_t h) noexcept {
  h = (h ^ (h >> 30)) * 0xBF58476D1CE4E5B9u;
  h = (h ^ (h >> 27)) * 0x94D049BB133111EBu;
  return h ^ (h >> 31);
}

/// Where nodes went that were taken out: the node that stands for each, and how it stood to it.
/// What is measured at such a node later is told from there instead.
///
/// When full, the oldest entry gives way: what is measured there later has nowhere to go.
///
/// Memory   `capacity` entries and twice as many integers, from the arena.
/// Time     put, find: O(1); resolve: O(length of the chain).
/// Math     docs/math/skeleton.md, eq. 23.
template <class Space, class Key>
class Forwarding {
 public:
  struct Entry {
    Key node{};
    Key hub{};
    typename Space::Pose T_hub_node;
    std::array<float, Space::kDim*(Space::kDim + 1) / 2> covariance{};  ///< lower triangle
  };

  Forwarding(int capacity, Arena& arena)
      : entries_{arena.make_array<Entry>(capacity, "skeleton/forwarding")},
        next_{arena.make_array<int>(capacity, "skeleton/forwarding")},
        heads_{arena.make_array<int>(std::bit_ceil(static_cast<std::size_t>(capacity) + 1),
                                     "skeleton/forwarding")} {
    clear();
  }

  void clear() noexcept {
    for (int& h : heads_) h = kNone;
    end_ = count_ = 0;
  }

  void put(const Key& node, const Key& hub, const Relation<Space>& hub_node) noexcept {
    if (entries_.empty()) return;
    const int at = end_;
    end_ = end_ + 1 < static_cast<int>(entries_.size()) ? end_ + 1 : 0;
    if (count_ == static_cast<int>(entries_.size())) {
      unlink(at);
      ++forgotten_;
    } else {
      ++count_;
    }
    Entry& e = entries_[at];
    e.node = node;
    e.hub = hub;
    e.T_hub_node = hub_node.T;
    int k = 0;
    for (int r = 0; r < Space::kDim; ++r)
      for (int c = 0; c <= r; ++c)
        e.covariance[k++] = static_cast<float>(hub_node.covariance(r, c));
    int& head = heads_[bucket(node)];
    next_[at] = head;
    head = at;
  }

  /// @return the latest entry of a node, or nullptr
  [[nodiscard]] const Entry* find(const Key& node) const noexcept {
    for (int at = heads_[bucket(node)]; at != kNone; at = next_[at])
      if (entries_[at].node == node) return &entries_[at];
    return nullptr;
  }

  /// Follows the chain from a node that was taken out to one that `stands`. `relation` becomes
  /// T_hub_node. @return whether it ends at one; hub is it
  template <class Stands>
  [[nodiscard]] bool resolve(const Key& node, Stands&& stands, Key& hub,
                             Relation<Space>& relation) const noexcept {
    relation = {};
    hub = node;
    for (int k = 0; k < kLongest; ++k) {
      if (stands(hub)) return true;
      const Entry* e = find(hub);
      if (e == nullptr) return false;
      relation = Relation<Space>{e->T_hub_node, full(*e)}.then(relation);
      hub = e->hub;
    }
    return false;
  }

  [[nodiscard]] int count() const noexcept { return count_; }
  [[nodiscard]] std::uint64_t forgotten() const noexcept { return forgotten_; }

 private:
  static constexpr int kNone = -1;
  static constexpr int kLongest = 1000;  // steps of a chain

  [[nodiscard]] std::size_t bucket(const Key& key) const noexcept {
    return static_cast<std::size_t>(hash_of(key)) & (heads_.size() - 1);
  }
  [[nodiscard]] static typename Space::Block full(const Entry& e) noexcept {
    typename Space::Block out;
    int k = 0;
    for (int r = 0; r < Space::kDim; ++r)
      for (int c = 0; c <= r; ++c) out(r, c) = out(c, r) = static_cast<double>(e.covariance[k++]);
    return out;
  }
  void unlink(int at) noexcept {
    int* link = &heads_[bucket(entries_[at].node)];
    while (*link != at) link = &next_[*link];
    *link = next_[at];
  }

  std::span<Entry> entries_;
  std::span<int> next_;
  std::span<int> heads_;
  int end_ = 0;
  int count_ = 0;
  std::uint64_t forgotten_ = 0;
};

}  // namespace maplet
