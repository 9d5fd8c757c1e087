// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// A start from nothing but the measurements: docs/math/skeleton.md, section 13.
#include <Eigen/SVD>
#include <cmath>

#include "core/skeleton/linearise.hpp"
#include "core/skeleton/pose_graph.hpp"

namespace maplet {

namespace {

/// From R^T's first column. One that says nothing changes nothing.
void set_rotation(const Eigen::Vector3d& first, const Eigen::Vector3d& /*none*/,
                  Se2& pose) noexcept {
  const double length = std::hypot(first[0], first[1]);
  if (!(length > 1e-9)) return;
  pose.c = first[0] / length;
  pose.s = -first[1] / length;
}
/// The rotation next to what R^T's first two columns say.
void set_rotation(const Vector6d& first, const Vector6d& second, Se3& pose) noexcept {
  const Eigen::Vector3d x = first.head<3>();
  const Eigen::Vector3d y = second.head<3>();
  const double size = std::sqrt(x.norm() * y.norm());
  if (!(size > 1e-9)) return;
  Eigen::Matrix3d m;  // R
  m << x.transpose(), y.transpose(), x.cross(y).transpose() / size;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd{m, Eigen::ComputeFullU | Eigen::ComputeFullV};
  Eigen::Matrix3d u = svd.matrixU();
  if ((u * svd.matrixV().transpose()).determinant() < 0.0) u.col(2) *= -1.0;
  const Eigen::Quaterniond q{Eigen::Matrix3d{u * svd.matrixV().transpose()}};
  if (q.coeffs().allFinite()) pose.q = q.normalized();
}

void set_position(const Eigen::Vector2d& p, Se2& pose) noexcept {
  pose.x = p.x();
  pose.y = p.y();
}
void set_position(const Eigen::Vector3d& p, Se3& pose) noexcept { pose.t = p; }

}  // namespace

template <class Space>
bool PoseGraph<Space>::fits() const noexcept {
  double rows = 0.0;
  for (int i = 0; i < graph_.factor_end(); ++i)
    if (graph_.factor(i).state.active) rows += Space::kDim;
  for (int i = 0; i < graph_.node_end(); ++i) {
    const Node<Space>& n = graph_.node(i);
    if (n.used && n.group != i) rows -= Space::kDim;
  }
  const double spread = 4.0 * std::sqrt(2.0 * std::max(rows, 1.0));
  return rows < 1.0 || std::abs(stepper_.chi2() - rows) <= spread;
}

template <class Space>
void PoseGraph<Space>::begin_relaxed(Model model) noexcept {
  if (elimination_.busy()) elimination_.abandon();
  for (int k = 0; k < job_count_; ++k) graph_.factor(job_[k]).state.in_job = false;
  drop_columns();
  start_fresh_job(0.0, model);
  relaxed_ = model;
}

// R^T by eq. 29, column by column, the last one by the others; then the rotation next to it.
template <class Space>
void PoseGraph<Space>::turn_relaxed() noexcept {
  constexpr int kPoint = Space::kPoint;
  for (int column = 0; column + 1 < kPoint; ++column) {
    stepper_.solve_all(
        [&](int i) {
          Tangent right = Tangent::Zero();
          const Node<Space>& n = graph_.node(i);
          auto head = right.template head<kPoint>();
          if (n.anchor > 0.0) head = n.anchor * measure::rotation(n.pose).transpose().col(column);
          graph_.for_each_incident(i, [&](int index, int) {
            const Factor<Space>& f = graph_.factor(index);
            if (f.kind == FactorKind::kPrior && f.state.active)
              head += mean_information(f, Model::kRotations) *
                      measure::rotation(f.z).transpose().col(column);
          });
          return right;
        },
        [&](int i, const Tangent& solution) { stepper_.keep(i, column == 1, solution); });
  }
  for (int i = 0; i < graph_.node_end(); ++i) {
    Node<Space>& n = graph_.node(i);
    if (n.used && elimination_.contains(i) && n.anchor == 0.0)
      set_rotation(stepper_.kept(i, false), stepper_.kept(i, true), n.pose);
  }
}

// Positions given the rotations, eq. 30.
template <class Space>
void PoseGraph<Space>::place_relaxed() noexcept {
  constexpr int kPoint = Space::kPoint;
  using Vector = Eigen::Matrix<double, kPoint, 1>;
  stepper_.solve_all(
      [&](int i) {
        Tangent right = Tangent::Zero();
        const Node<Space>& n = graph_.node(i);
        auto head = right.template head<kPoint>();
        if (n.anchor > 0.0) head = n.anchor * measure::position(n.pose);
        graph_.for_each_incident(i, [&](int index, int) {
          const Factor<Space>& f = graph_.factor(index);
          if (!f.state.active) return;
          const double information = mean_information(f, Model::kPositions);
          if (f.kind == FactorKind::kPrior) {
            head += information * measure::position(f.z);
            return;
          }
          const Vector step =
              measure::rotation(graph_.node(f.a).pose) * Vector{measure::position(f.z)};
          head += (f.b == i ? information : -information) * step;
        });
        return right;
      },
      [&](int i, const Tangent& solution) {
        Node<Space>& n = graph_.node(i);
        const Vector at = solution.template head<kPoint>();
        if (n.anchor == 0.0 && at.allFinite()) set_position(at, n.pose);
      });
}

template <class Space>
Stop PoseGraph<Space>::start_anew(Deadline deadline) noexcept {
  if (relaxed_ == Model::kExact) {
    for (int i = 0; i < graph_.factor_end(); ++i)
      if (graph_.factor(i).state.active && measure::is_sight(graph_.factor(i).kind))
        return Stop::kIterationLimit;
    begin_relaxed(Model::kRotations);
  }
  Allowance allowance{deadline, policy_.work_per_update + policy_.work_per_update / 2};
  // What follows an elimination is not divided: in the next call, when this one has no room for it.
  const std::int64_t turn = 4 * Stepper<Space>::kFactorWork * graph_.factor_count();
  for (;;) {
    auto result = Elimination<Space>::Result::kCommitted;
    if (elimination_.busy()) {
      result = elimination_.run(allowance);
      const bool committed = result == Elimination<Space>::Result::kCommitted;
      if (committed ? !allowance.fits(turn) : result == Elimination<Space>::Result::kDeadline)
        return Stop::kDeadline;
    }
    const bool turning = relaxed_ == Model::kRotations;
    relaxed_ = Model::kExact;
    settled_ = false;
    refresh_ = job_first_ = wants_step_ = true;
    if (result == Elimination<Space>::Result::kFull) {
      overcome_overflow();
      return Stop::kIterationLimit;
    }
    finish_job();
    if (!turning) break;
    turn_relaxed();
    begin_relaxed(Model::kPositions);
    (void)allowance.spend(turn);
  }
  place_relaxed();
  (void)chi2();
  stepper_.forget_step();
  return Stop::kConverged;
}

#define MAPLET_INSTANTIATE(Space)                                \
  template bool PoseGraph<Space>::fits() const noexcept;         \
  template void PoseGraph<Space>::begin_relaxed(Model) noexcept; \
  template void PoseGraph<Space>::turn_relaxed() noexcept;       \
  template void PoseGraph<Space>::place_relaxed() noexcept;      \
  template Stop PoseGraph<Space>::start_anew(Deadline) noexcept;
MAPLET_INSTANTIATE(PlanarSpace)
MAPLET_INSTANTIATE(SpatialSpace)
#undef MAPLET_INSTANTIATE

}  // namespace maplet
