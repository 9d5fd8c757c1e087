// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstring>
#include <span>

#include "core/base/arena.hpp"

namespace maplet {

/// One entry of a column: which row, whose column, and scratch.
struct ColumnSlot {
  int row;    ///< node
  int owner;  ///< node whose column this is
  int link;   ///< the ordering's and the elimination's scratch
};

/// Where the columns of the factor live: one array of slots, each a block and the row it stands in.
/// A column is a run of slots, the diagonal first. Columns are only ever appended; what they
/// replace becomes garbage until compact() slides the live ones together.
///
/// Memory   `max_blocks` blocks and twelve bytes beside each.
/// Time     append O(1); compact O(slots in use).
template <int D>
class ColumnPool {
 public:
  static constexpr int kNone = -1;
  static constexpr int kBlockSize = D * D;

  ColumnPool(int max_nodes, int max_blocks, Arena& arena)
      : blocks_{arena.make_array<double>(static_cast<std::size_t>(max_blocks) * kBlockSize + 1,
                                         "skeleton/factor blocks")},
        slots_{arena.make_array<ColumnSlot>(max_blocks, "skeleton/factor rows")},
        start_{arena.make_array<int>(max_nodes, "skeleton/columns")},
        length_{arena.make_array<int>(max_nodes, "skeleton/columns")} {
    clear();
  }

  void clear() noexcept {
    for (int& s : start_) s = kNone;
    for (int& l : length_) l = 0;
    end_ = live_ = from_ = to_ = 0;
  }

  [[nodiscard]] double* block(int slot) noexcept { return blocks_.data() + kBlockSize * slot; }
  [[nodiscard]] const double* block(int slot) const noexcept {
    return blocks_.data() + kBlockSize * slot;
  }
  [[nodiscard]] ColumnSlot& slot(int i) noexcept { return slots_[i]; }
  [[nodiscard]] const ColumnSlot& slot(int i) const noexcept { return slots_[i]; }
  [[nodiscard]] bool has(int node) const noexcept { return start_[node] != kNone; }
  [[nodiscard]] int start(int node) const noexcept { return start_[node]; }
  [[nodiscard]] int length(int node) const noexcept {
    return length_[node];
  }  ///< with the diagonal
  [[nodiscard]] int end() const noexcept { return end_; }
  [[nodiscard]] int capacity() const noexcept { return static_cast<int>(slots_.size()); }
  [[nodiscard]] int free_slots() const noexcept { return capacity() - end_; }
  [[nodiscard]] int live() const noexcept { return live_; }

  [[nodiscard]] std::span<ColumnSlot> slots() noexcept { return slots_; }

  /// Takes the next `count` slots in use and zeroes their blocks. @pre count <= free_slots()
  void append(int count) noexcept {
    std::memset(block(end_), 0, sizeof(double) * kBlockSize * count);
    end_ += count;
  }
  /// Makes a run of appended slots the column of `node`, in place of the one it had.
  void adopt(int node, int first, int length) noexcept {
    live_ += length - length_[node];
    start_[node] = first;
    length_[node] = length;
  }
  void drop(int node) noexcept {
    live_ -= length_[node];
    start_[node] = kNone;
    length_[node] = 0;
  }
  /// Forgets everything appended at or after `end`: an elimination that was given up.
  void rewind(int end) noexcept { end_ = end; }

  /// Slides the columns together. @pre no appended slot is without its column
  void compact() noexcept {
    for (int round = 0; round < 2 && live_ < end_; ++round) slide(capacity());  // one is half way
  }
  /// Goes on sliding them together, about `slots` further: [0, to_) is done, [to_, from_) a hole.
  /// @pre as compact
  void compact_some(int slots) noexcept {
    if (from_ > 0 || live_ < end_ - end_ / 4) slide(slots);  // else not worth it yet
  }

 private:
  void slide(int slots) noexcept {
    const int stop = slots < end_ - from_ ? from_ + slots : end_;
    while (from_ < stop) {
      const int owner = slots_[from_].owner;
      if (start_[owner] != from_) {
        ++from_;
        continue;
      }
      const int n = length_[owner];
      if (to_ != from_) {
        std::memmove(block(to_), block(from_), sizeof(double) * kBlockSize * n);
        std::memmove(&slots_[to_], &slots_[from_], sizeof(ColumnSlot) * n);
        start_[owner] = to_;
      }
      to_ += n;
      from_ += n;
    }
    if (from_ < end_) return;
    end_ = to_;
    from_ = to_ = 0;
  }

  std::span<double> blocks_;
  std::span<ColumnSlot> slots_;
  std::span<int> start_;
  std::span<int> length_;
  int end_ = 0;
  int live_ = 0;
  int from_ = 0;  ///< of a compaction under way
  int to_ = 0;
};

}  // namespace maplet
