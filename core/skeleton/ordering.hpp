// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/skeleton/column_pool.hpp"

namespace maplet {

/// Approximate minimum degree on a quotient graph, one pivot at a time.
///
/// The graph is a set of variables, edges between them, and elements: cliques left behind by what
/// was eliminated before. An element's list of variables is the list of rows of a column; the
/// caller owns those lists (the pool of columns), so that ordering and symbolic factorisation are
/// one pass.
///
/// Memory   a dozen integers per node and two per edge; no copy of any list of rows.
/// Time     each pivot O(its column's length * elements per row).
/// Math     docs/math/skeleton.md, section 4 (Amestoy, Davis, Duff 1996, without supervariables).
class Ordering {
 public:
  static constexpr int kNone = -1;

  /// @param slots  where rows of columns are kept: the elements' and those this writes
  Ordering(int max_nodes, int max_factors, std::span<ColumnSlot> slots, Arena& arena);

  /// Ties are broken by these from now on, one a node, instead of by what came first: the order
  /// then depends on the graph alone. Empty: as they come, which is quicker.
  void break_ties_by(std::span<const int> names) noexcept { names_ = names; }
  /// Starts over with no variables.
  void clear() noexcept;
  /// Adds a variable. @param last it is eliminated after all that are not
  void add_variable(int node, bool last) noexcept;
  [[nodiscard]] bool contains(int node) const noexcept { return item_[node].epoch == epoch_; }
  /// Adds the edges of a variable; call once each, other variables only, duplicates allowed.
  void begin_edges(int node) noexcept;
  void add_edge(int node, int other) noexcept;
  /// Adds a clique: the rows in slots [begin, end), variables all; `element` names it.
  void add_element(int element, int begin, int end) noexcept;
  /// To call when all is in, with all variables.
  void ready(std::span<const int> variables) noexcept;

  [[nodiscard]] int remaining() const noexcept { return remaining_; }
  /// The cheapest variable left. @pre remaining() > 0
  [[nodiscard]] int pick() noexcept;
  /// Eliminates `pivot` and writes its column, diagonal first, rows unsorted, to slots from `at`.
  /// @return the column's length, or kNone when `room` slots do not hold it: give up the ordering
  [[nodiscard]] int eliminate(int pivot, int at, int room) noexcept;

 private:
  struct Item {
    std::int64_t epoch = 0;  ///< variable of this ordering
    bool eliminated = false;
    bool last = false;
    int degree = 0;
    int bucket_next = kNone;
    int bucket_prev = kNone;
    int first_slot = kNone;  ///< its elements, as slots of rows
    int first_edge = 0;      ///< into edges_
    int edge_count = 0;
    std::int64_t mark = 0;
    // As an element:
    bool alive = false;
    int size = 0;  ///< variables in it
    int outside = 0;
    std::int64_t outside_mark = 0;
    int rows_begin = 0;
    int rows_end = 0;
  };

  void insert(int node, int degree) noexcept;
  void take_out(int node) noexcept;
  int write_column(int pivot, int at, int room) noexcept;
  void measure_outside(int pivot, int at, int end) noexcept;
  void update_degree(int node, int pivot, int others) noexcept;

  std::span<ColumnSlot> slots_;
  std::span<const int> names_;
  std::span<Item> item_;
  std::span<int> bucket_;
  std::span<int> edges_;
  std::span<int> last_;
  int last_count_ = 0;
  int last_next_ = 0;
  std::int64_t epoch_ = 0;
  std::int64_t mark_ = 0;
  int edge_end_ = 0;
  int remaining_ = 0;
  int free_count_ = 0;
  int lowest_ = 0;
};

}  // namespace maplet
