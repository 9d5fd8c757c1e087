// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The fit of one relation: where it starts from, and how it goes on.
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "core/skeleton/frame_finder.hpp"
#include "core/skeleton/linearise.hpp"

namespace maplet {

namespace {

constexpr double kHuber = 3.0;  // sigmas

/// Unit rotation k of a set that covers the group; points need none.
Se2 turn(int k, PlanarSpace) noexcept { return Se2::from(0.0, 0.0, k * M_PI / 4.0); }
Se3 turn(int k, SpatialSpace) noexcept {  // the 24 rotations of a cube
  using Eigen::AngleAxisd;
  using Eigen::Vector3d;
  const int face = k / 4;
  Eigen::Quaterniond q{AngleAxisd{face * M_PI / 2.0, Vector3d::UnitY()}};
  if (face >= 4) q = AngleAxisd{(face == 4 ? 0.5 : -0.5) * M_PI, Vector3d::UnitX()};
  return {q * Eigen::Quaterniond{AngleAxisd{(k % 4) * M_PI / 2.0, Vector3d::UnitZ()}},
          Vector3d::Zero()};
}
constexpr int turns(PlanarSpace) noexcept { return 8; }
constexpr int turns(SpatialSpace) noexcept { return 24; }

Eigen::Vector2d direction(int k, PlanarSpace) noexcept {
  return {std::cos(k * M_PI / 4.0), std::sin(k * M_PI / 4.0)};
}
Eigen::Vector3d direction(int k, SpatialSpace) noexcept {  // a cube's faces and corners
  if (k < 6) return (k % 2 == 0 ? 1.0 : -1.0) * Eigen::Vector3d::Unit(k / 2);
  return Eigen::Vector3d{(k & 1) != 0 ? 1.0 : -1.0, (k & 2) != 0 ? 1.0 : -1.0,
                         (k - 6) >= 4 ? 1.0 : -1.0}
      .normalized();
}
constexpr int directions(PlanarSpace) noexcept { return 8; }
constexpr int directions(SpatialSpace) noexcept { return 14; }

void put(Se2& p, const Eigen::Vector2d& t) noexcept { p.x = t.x(), p.y = t.y(); }
void put(Se3& p, const Eigen::Vector3d& t) noexcept { p.t = t; }

double angle_of(const Se2& p) noexcept { return std::abs(p.angle()); }
double angle_of(const Se3& p) noexcept { return p.angle(); }

}  // namespace

template <class Space>
int FrameFinder<Space>::start_count() const noexcept {
  return directions(Space{}) * (point_ ? 1 : turns(Space{}));
}

template <class Space>
auto FrameFinder<Space>::start(int index) const noexcept -> Pose {
  Pose T = turn(index / directions(Space{}), Space{});
  put(T, centre_a_ + range_ * direction(index % directions(Space{}), Space{}) -
             measure::rotation(T) * centre_b_);
  return T;
}

template <class Space>
double FrameFinder<Space>::evaluate(const Pose& T, int samples, Block* h,
                                    Tangent* g) const noexcept {
  const auto& nodes = graph_.graph();
  double cost = 0.0;
  for (int k = 0; k < samples; ++k) {
    const Factor<Space>& f = nodes.factor(samples_[k]);
    const bool turned = graph_.group(f.a) != group_a_;
    const Pose& in_b = nodes.node(turned ? f.a : f.b).pose;
    const Pose moved = Space::compose(T, in_b);
    const Pose rel = turned ? Space::between(moved, nodes.node(f.b).pose)
                            : Space::between(nodes.node(f.a).pose, moved);
    const Tangent e = measure::error(f, rel);
    const Tangent v = weigh(f, e);
    const double chi2 = e.dot(v);
    const double far = std::sqrt(chi2) / kHuber;
    cost += far > 1.0 ? kHuber * kHuber * (2.0 * far - 1.0) : chi2;
    if (h == nullptr) continue;
    const double weight = far > 1.0 ? 1.0 / far : 1.0;
    Block by_a, by_b, minus_adjoint, ignored;
    measure::jacobians(f, rel, e, by_a, by_b);
    Space::jacobians(in_b, in_b, Tangent::Zero(), minus_adjoint, ignored);  // -Ad(in_b^-1)
    const Block j = -(turned ? by_a : by_b) * minus_adjoint;
    *h += weight * j.transpose() * unpack<Space>(f.information) * j;
    *g -= weight * j.transpose() * v;
  }
  return cost;
}

template <class Space>
double FrameFinder<Space>::fit(Pose& T, int samples, int iterations,
                               Block* hessian_out) const noexcept {
  double damping = 1e-3;
  Block h = Block::Zero();
  Tangent g = Tangent::Zero();
  double cost = evaluate(T, samples, &h, &g);
  for (int k = 0; k < iterations; ++k) {
    Block damped = h;
    damped.diagonal() *= 1.0 + damping;
    damped.diagonal().array() += 1e-12;
    if (point_) damped.diagonal().template tail<Space::kDim - Space::kPoint>().array() += 1.0;
    if (point_) g.template tail<Space::kDim - Space::kPoint>().setZero();
    const Pose next = Space::retract(T, damped.llt().solve(g));
    const double there = Space::finite(next) ? evaluate(next, samples, nullptr, nullptr) : cost;
    if (there < cost) {
      const bool done = cost - there < 1e-6 * cost;
      T = next;
      h.setZero();
      g.setZero();
      cost = evaluate(T, samples, &h, &g);
      damping = std::max(0.2 * damping, 1e-9);
      if (done) break;
    } else {
      damping *= 10.0;
      if (damping > 1e6) break;
    }
  }
  if (hessian_out != nullptr) *hessian_out = h;
  return cost;
}

template <class Space>
bool FrameFinder<Space>::same(const Pose& x, const Pose& y) const noexcept {
  const Pose d = Space::between(x, y);
  if (!point_ && angle_of(d) > 0.2) return false;
  const auto middle = [&](const Pose& T) {
    return (measure::rotation(T) * centre_b_ + measure::position(T)).eval();
  };
  return (middle(x) - middle(y)).norm() < 0.1 * range_;
}

#define MAPLET_INSTANTIATE(Space)                                                                \
  template int FrameFinder<Space>::start_count() const noexcept;                                 \
  template Space::Pose FrameFinder<Space>::start(int) const noexcept;                            \
  template double FrameFinder<Space>::evaluate(const Space::Pose&, int, Space::Block*,           \
                                               Space::Tangent*) const noexcept;                  \
  template double FrameFinder<Space>::fit(Space::Pose&, int, int, Space::Block*) const noexcept; \
  template bool FrameFinder<Space>::same(const Space::Pose&, const Space::Pose&) const noexcept;
MAPLET_INSTANTIATE(PlanarSpace)
MAPLET_INSTANTIATE(SpatialSpace)
#undef MAPLET_INSTANTIATE

}  // namespace maplet
