// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/skeleton/allowance.hpp"
#include "core/skeleton/column_pool.hpp"
#include "core/skeleton/graph.hpp"
#include "core/skeleton/linearise.hpp"
#include "core/skeleton/ordering.hpp"

namespace maplet {

/// The block Cholesky factor of the graph's Hessian as an elimination tree, and how it follows the
/// graph: only the paths from touched nodes to the root are ordered and eliminated anew.
///
/// What lies below the paths enters nowhere: the Hessian of the nodes on them, given all below, is
/// what their old columns multiply out to, so no update matrices are kept (eq. 9). The job can be
/// cut at any column; until it commits, the old factor stays in use.
///
/// Memory   fixed: the pool of columns, the ordering's and a dozen integers per node.
/// Time     begin O(nodes on the paths and their rows); run until the deadline, overrunning by one
///          column. A step that only adds a pose at the root is O(1).
/// Math     docs/math/skeleton.md, section 3-4.
template <class Space>
class Elimination {
 public:
  static constexpr int kNone = -1;
  static constexpr int kDim = Space::kDim;
  static constexpr int kProductWork = kDim == 6 ? 4 : 1;  ///< of a product of two blocks

  enum class Result : std::uint8_t { kCommitted, kDeadline, kFull };

  Elimination(Graph<Space>& graph, int max_blocks, Arena& arena);

  /// A job: touch nodes and those to keep last, then begin, then run until kCommitted.
  void clear_job() noexcept;
  /// The node and all on its path to the root will be eliminated anew.
  void touch(int node) noexcept;
  /// @pre touched; eliminated after the others, the later the more recently said
  void keep_last(int node) noexcept;
  /// Everything touched; forgets the old factor's values, which takes `damping` * diag(H) in.
  /// @param model  a relaxation: its factor serves no other purpose than to solve it
  void touch_all(double damping, Model model = Model::kExact) noexcept;
  void begin() noexcept;
  /// From now on what a job comes to depends on the graph and its nodes' seniority alone, not on
  /// who came first; or no longer. @pre no node comes or goes in between
  void order_by_seniority(bool on) noexcept;
  [[nodiscard]] Result run(Allowance& allowance) noexcept;
  [[nodiscard]] bool busy() const noexcept { return phase_ != Phase::kIdle; }
  /// Gives the job up; the factor stays as it was. Possible before kCommitted, in the ordering
  /// only.
  void abandon() noexcept;
  /// Throws the pool's garbage out. @pre !busy()
  void compact() noexcept { pool_.compact(); }
  /// Forgets the whole factor: nothing is eliminated any more. @pre !busy()
  void clear() noexcept;
  /// Forgets a node that no factor touches and no column holds as a row. @pre !busy()
  void forget(int node) noexcept;

  // The committed factor.
  [[nodiscard]] const ColumnPool<kDim>& pool() const noexcept { return pool_; }
  [[nodiscard]] bool contains(int node) const noexcept { return pool_.has(node); }
  [[nodiscard]] int parent(int node) const noexcept { return tree_[node].parent; }
  [[nodiscard]] int first_child(int node) const noexcept { return tree_[node].first_child; }
  [[nodiscard]] int next_sibling(int node) const noexcept { return tree_[node].next; }
  [[nodiscard]] int first_root() const noexcept { return first_root_; }
  [[nodiscard]] std::int64_t rank(int node) const noexcept { return tree_[node].rank; }
  /// Pivots that had to be damped since the start.
  [[nodiscard]] std::uint64_t damped_pivots() const noexcept { return damped_; }
  /// Nodes of the last job.
  [[nodiscard]] std::span<const int> affected() const noexcept {
    return {nodes_.data(), std::size_t(count_)};
  }

 private:
  enum class Phase : std::uint8_t { kIdle, kOrder, kNumeric };

  struct Link {  // the tree; siblings are linked both ways
    int parent = kNone;
    int first_child = kNone;
    int next = kNone;
    int prev = kNone;
    std::int64_t rank = -1;
  };
  struct Work {  // of a node in the job
    std::int64_t job = 0;
    bool last = false;
    int start = kNone;  ///< new column
    int length = 0;
    std::int64_t rank = 0;
    int position = kNone;  ///< slot of this row in the column being eliminated
    // Columns whose next row is this node; their cursor.
    int old_head = kNone, old_next = kNone, old_cursor = 0;
    int new_head = kNone, new_next = kNone, new_cursor = 0;
  };

  [[nodiscard]] bool in_job(int node) const noexcept { return work_[node].job == job_; }
  void prepare_ordering() noexcept;
  void sort_by_new_rank() noexcept;
  void eliminate(int node) noexcept;
  void add_old_columns(int node) noexcept;
  void add_factors(int node) noexcept;
  void subtract_new_columns(int node) noexcept;
  void factorise_column(int node) noexcept;
  void commit() noexcept;
  void unlink(int node) noexcept;
  void link(int node, int parent) noexcept;

  Graph<Space>& graph_;
  ColumnPool<kDim> pool_;
  Ordering ordering_;
  std::span<Link> tree_;
  std::span<Work> work_;
  std::span<double> anchored_;  ///< the anchor's information that each node's column holds
  std::span<int> nodes_;        ///< of the job; in the new order once ordered
  std::span<int> last_;         ///< to keep last
  std::span<int> names_;        ///< places in the order of seniority
  bool by_seniority_ = false;
  std::span<int> orphans_;  ///< children of the job's nodes that are not in it
  std::int64_t job_ = 0;
  std::int64_t next_rank_ = 0;
  int count_ = 0;
  int last_count_ = 0;
  int orphan_count_ = 0;
  int ordered_ = 0;
  int eliminated_ = 0;
  int pool_mark_ = 0;
  int first_root_ = kNone;
  Phase phase_ = Phase::kIdle;
  bool everything_ = false;
  double damping_ = 0.0;
  Model model_ = Model::kExact;
  std::uint64_t damped_ = 0;
  int effort_ = 0;
};

extern template class Elimination<PlanarSpace>;
extern template class Elimination<SpatialSpace>;

}  // namespace maplet
