// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The numbers of one column: docs/math/skeleton.md, eq. 8-10.
#include "core/skeleton/block_kernels.hpp"
#include "core/skeleton/elimination.hpp"

namespace maplet {

template <class Space>
void Elimination<Space>::eliminate(int node) noexcept {
  const Work& w = work_[node];
  for (int s = w.start; s < w.start + w.length; ++s) work_[pool_.slot(s).row].position = s;
  if (!everything_) add_old_columns(node);
  add_factors(node);
  Eigen::Map<typename Space::Block> diagonal{pool_.block(w.start)};
  if (everything_) {
    diagonal.diagonal() *= 1.0 + damping_;
    anchored_[node] = 0.0;
  }
  // A point's orientation: nothing measures it, nothing couples to it, it stays where it is.
  if (graph_.node(node).point && (everything_ || !pool_.has(node)))
    diagonal.diagonal().template tail<kDim - Space::kPoint>().array() += 1.0;
  if (model_ != Model::kExact) {  // what the relaxation has no word for
    diagonal.diagonal().template tail<kDim - Space::kPoint>().array() += 1.0;
    if (!(diagonal(0, 0) > 0.0)) diagonal.diagonal().array() += 1.0;
  }
  diagonal.diagonal().array() += graph_.node(node).anchor - anchored_[node];
  anchored_[node] = graph_.node(node).anchor;
  subtract_new_columns(node);
  if (graph_.node(node).retired) diagonal.setIdentity();  // nothing is left to be known of it
  for (int s = w.start; s < w.start + w.length; ++s) work_[pool_.slot(s).row].position = kNone;
  factorise_column(node);
}

// S(r, node) += B_r B_node^T for each old column that holds the node: what it multiplies out to.
template <class Space>
void Elimination<Space>::add_old_columns(int node) noexcept {
  for (int j = work_[node].old_head; j != kNone;) {
    Work& old = work_[j];
    const int next = old.old_next;
    const int end = pool_.start(j) + pool_.length(j);
    const double* mine = pool_.block(pool_.slot(old.old_cursor).link);
    for (int c = old.old_cursor; c < end; ++c) {
      const int from = pool_.slot(c).link;
      // A row that is not in the new column is fill that the old order made: its sum is zero.
      const int to = work_[pool_.slot(from).row].position;
      if (to != kNone) block::add_product<kDim>(pool_.block(to), pool_.block(from), mine);
    }
    effort_ += kProductWork * (end - old.old_cursor);
    if (++old.old_cursor < end) {
      Work& row = work_[pool_.slot(pool_.slot(old.old_cursor).link).row];
      old.old_next = row.old_head;
      row.old_head = j;
    }
    j = next;
  }
}

// New and changed factors, at the first of their nodes: their Hessian now less the one held so far.
template <class Space>
void Elimination<Space>::add_factors(int node) noexcept {
  using Map = Eigen::Map<typename Space::Block>;
  graph_.for_each_incident(node, [&](int index, int other) {
    Factor<Space>& f = graph_.factor(index);
    if (!f.state.in_job) return;
    if (other != kNone && work_[other].rank < work_[node].rank) return;
    const auto add = [&](const typename Space::Pose& rel, double weight, double sign) {
      const HessianBlocks<Space> h =
          model_ == Model::kExact ? hessian(f, rel, sign * weight) : relaxed_hessian(f, model_);
      const bool first = f.a == node;
      Map{pool_.block(work_[node].start)} += first ? h.aa : h.bb;
      if (other == kNone) return;
      Map{pool_.block(work_[other].start)} += first ? h.bb : h.aa;
      if (const int to = work_[other].position; to != kNone) {
        if (first) {
          Map{pool_.block(to)} += h.ba;
        } else {
          Map{pool_.block(to)} += h.ba.transpose();
        }
      }
    };
    if (f.state.integrated && !everything_) add(f.rel_lin, f.weight_lin, -1.0);
    f.state.integrated = f.state.active;
    if (!f.state.active) return;
    f.rel_lin = relative_pose(graph_, f);
    f.weight_lin = f.weight;
    add(f.rel_lin, f.weight_lin, 1.0);
    effort_ += 16 * kProductWork;
  });
}

// S(r, node) -= L_r L_node^T for each new column that holds the node.
template <class Space>
void Elimination<Space>::subtract_new_columns(int node) noexcept {
  for (int k = work_[node].new_head; k != kNone;) {
    Work& column = work_[k];
    const int next = column.new_next;
    const int end = column.start + column.length;
    const double* mine = pool_.block(column.new_cursor);
    for (int c = column.new_cursor; c < end; ++c)
      block::subtract_product<kDim>(pool_.block(work_[pool_.slot(c).row].position), pool_.block(c),
                                    mine);
    effort_ += kProductWork * (end - column.new_cursor);
    if (++column.new_cursor < end) {
      Work& row = work_[pool_.slot(column.new_cursor).row];
      column.new_next = row.new_head;
      row.new_head = k;
    }
    k = next;
  }
}

template <class Space>
void Elimination<Space>::factorise_column(int node) noexcept {
  Work& w = work_[node];
  double* diagonal = pool_.block(w.start);
  typename Space::Block whole = Eigen::Map<typename Space::Block>{diagonal};
  whole = (0.5 * (whole + whole.transpose())).eval();
  Eigen::Map<typename Space::Block>{diagonal} = whole;
  // A pivot that fails is damped until it holds: the step gets shorter there, nothing breaks.
  double extra = 1e-9 * std::max(whole.diagonal().cwiseAbs().maxCoeff(), 1e-9);
  while (!block::cholesky<kDim>(diagonal)) {
    ++damped_;
    if (!whole.allFinite() || extra > 1e100) {
      whole.setIdentity();
      for (int s = w.start + 1; s < w.start + w.length; ++s)
        std::fill_n(pool_.block(s), kDim * kDim, 0.0);
    } else {
      whole.diagonal().array() += extra;
      extra *= 100.0;
    }
    Eigen::Map<typename Space::Block>{diagonal} = whole;
  }
  for (int s = w.start + 1; s < w.start + w.length; ++s)
    block::solve_right<kDim>(pool_.block(s), diagonal);
  effort_ += kProductWork * w.length;
  if (w.length < 2) return;
  w.new_cursor = w.start + 1;
  Work& row = work_[pool_.slot(w.new_cursor).row];
  w.new_next = row.new_head;
  row.new_head = node;
}

#define MAPLET_INSTANTIATE(Space)                                       \
  template void Elimination<Space>::eliminate(int) noexcept;            \
  template void Elimination<Space>::add_old_columns(int) noexcept;      \
  template void Elimination<Space>::add_factors(int) noexcept;          \
  template void Elimination<Space>::subtract_new_columns(int) noexcept; \
  template void Elimination<Space>::factorise_column(int) noexcept;
MAPLET_INSTANTIATE(PlanarSpace)
MAPLET_INSTANTIATE(SpatialSpace)
#undef MAPLET_INSTANTIATE

}  // namespace maplet
