// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "core/skeleton/graph.hpp"

/// What a factor measures: its error and exact derivatives, of every kind, as functions of the
/// relative pose `rel` = T_a_b of its nodes (a prior: T_world_a).
///
/// Sights (range, bearing, position) see where b stands from a, whatever b's own orientation is: b
/// may be a pose or a point. Their error uses the first rows of a tangent, the others are zero:
///
///     planar   range, bearing    or  x, y
///     spatial  range, u - z (3)  or  x, y, z     u the unit vector towards b in a's frame
///
/// Math   docs/math/skeleton.md, eq. 2-7, 19-21.
namespace maplet::measure {

template <class Space>
using Point = Eigen::Matrix<double, Space::kPoint, 1>;
template <class Space>
using Rows = Eigen::Matrix<double, Space::kDim, Space::kPoint>;

inline Eigen::Vector2d position(const Se2& p) noexcept { return {p.x, p.y}; }
inline const Eigen::Vector3d& position(const Se3& p) noexcept { return p.t; }
inline Eigen::Matrix2d rotation(const Se2& p) noexcept {
  return (Eigen::Matrix2d{} << p.c, -p.s, p.s, p.c).finished();
}
inline Eigen::Matrix3d rotation(const Se3& p) noexcept { return p.rotation(); }

[[nodiscard]] inline bool is_sight(FactorKind kind) noexcept {
  return kind != FactorKind::kBetween && kind != FactorKind::kPrior;
}

/// How sights are stored as a pose. planar: range in x, bearing as the rotation; spatial: the unit
/// vector in t, the range in the quaternion's w.
inline Se2 make_sight(double range_m, double bearing_rad, PlanarSpace) noexcept {
  return {range_m, 0.0, std::cos(bearing_rad), std::sin(bearing_rad)};
}
inline Se3 make_sight(double range_m, const Eigen::Vector3d& direction, SpatialSpace) noexcept {
  return {Eigen::Quaterniond{range_m, 0.0, 0.0, 0.0}, direction.normalized()};
}
inline Se2 make_position(const Eigen::Vector2d& at) noexcept { return {at.x(), at.y(), 1.0, 0.0}; }
inline Se3 make_position(const Eigen::Vector3d& at) noexcept {
  return {Eigen::Quaterniond::Identity(), at};
}

inline constexpr double kNearest_m = 1e-6;  ///< a direction closer than this is none

inline Eigen::Vector3d sight_error(FactorKind kind, const Se2& z, const Se2& rel) noexcept {
  if (kind == FactorKind::kPosition) return {rel.x - z.x, rel.y - z.y, 0.0};
  Eigen::Vector3d e = Eigen::Vector3d::Zero();
  if (kind != FactorKind::kBearing) e[0] = std::hypot(rel.x, rel.y) - z.x;
  if (kind != FactorKind::kRange)
    e[1] = std::atan2(z.c * rel.y - z.s * rel.x, z.c * rel.x + z.s * rel.y);
  return e;
}
inline Vector6d sight_error(FactorKind kind, const Se3& z, const Se3& rel) noexcept {
  Vector6d e = Vector6d::Zero();
  if (kind == FactorKind::kPosition) {
    e.head<3>() = rel.t - z.t;
    return e;
  }
  const double range = rel.t.norm();
  if (kind != FactorKind::kBearing) e[0] = range - z.q.w();
  if (kind != FactorKind::kRange) e.segment<3>(1) = rel.t / std::max(range, kNearest_m) - z.t;
  return e;
}

/// Derivative of a sight's error by rel's position.
inline Rows<PlanarSpace> sight_rows(FactorKind kind, const Se2& rel) noexcept {
  Rows<PlanarSpace> j = Rows<PlanarSpace>::Zero();
  if (kind == FactorKind::kPosition) {
    j.topRows<2>().setIdentity();
    return j;
  }
  const double r = std::max(std::hypot(rel.x, rel.y), kNearest_m);
  if (kind != FactorKind::kBearing) j.row(0) << rel.x / r, rel.y / r;
  if (kind != FactorKind::kRange) j.row(1) << -rel.y / (r * r), rel.x / (r * r);
  return j;
}
inline Rows<SpatialSpace> sight_rows(FactorKind kind, const Se3& rel) noexcept {
  Rows<SpatialSpace> j = Rows<SpatialSpace>::Zero();
  if (kind == FactorKind::kPosition) {
    j.topRows<3>().setIdentity();
    return j;
  }
  const double r = std::max(rel.t.norm(), kNearest_m);
  const Eigen::Vector3d u = rel.t / r;
  if (kind != FactorKind::kBearing) j.row(0) = u.transpose();
  if (kind != FactorKind::kRange)
    j.middleRows<3>(1) = (Eigen::Matrix3d::Identity() - u * u.transpose()) / r;
  return j;
}

/// What turning a does to a sight's error (eq. 21).
inline Eigen::Matrix<double, 3, 1> by_turning(const Rows<PlanarSpace>& j, const Se2& rel) noexcept {
  return j * Eigen::Vector2d{rel.y, -rel.x};
}
inline Eigen::Matrix<double, 6, 3> by_turning(const Rows<SpatialSpace>& j,
                                              const Se3& rel) noexcept {
  return j * skew(rel.t);
}

template <class Space>
void sight_jacobians(FactorKind kind, const typename Space::Pose& rel, typename Space::Block& by_a,
                     typename Space::Block& by_b) noexcept {
  constexpr int kPoint = Space::kPoint;
  const Rows<Space> j = sight_rows(kind, rel);
  by_b.setZero();
  by_b.template leftCols<kPoint>() = j * rotation(rel);
  by_a.template leftCols<kPoint>() = -j;
  by_a.template rightCols<Space::kDim - kPoint>() = by_turning(j, rel);
}

template <class Space>
[[nodiscard, gnu::always_inline]] inline typename Space::Tangent error(
    const Factor<Space>& f, const typename Space::Pose& rel) noexcept {
  if (is_sight(f.kind)) return sight_error(f.kind, f.z, rel);
  return Space::error(f.z, rel);
}

/// By right perturbations of a and b. A prior: by_b is a's.
template <class Space>
void jacobians(const Factor<Space>& f, const typename Space::Pose& rel,
               const typename Space::Tangent& e, typename Space::Block& by_a,
               typename Space::Block& by_b) noexcept {
  if (is_sight(f.kind)) return sight_jacobians<Space>(f.kind, rel, by_a, by_b);
  Space::jacobians(f.z, rel, e, by_a, by_b);
}

template <class Space>
void pull_back(const Factor<Space>& f, const typename Space::Pose& rel,
               const typename Space::Tangent& e, const typename Space::Tangent& v,
               typename Space::Tangent& grad_a, typename Space::Tangent& grad_b) noexcept {
  if (!is_sight(f.kind)) return Space::pull_back(f.z, rel, e, v, grad_a, grad_b);
  typename Space::Block by_a, by_b;
  sight_jacobians<Space>(f.kind, rel, by_a, by_b);
  grad_a.noalias() = by_a.transpose() * v;
  grad_b.noalias() = by_b.transpose() * v;
}

template <class Space>
[[nodiscard]] typename Space::Tangent push_forward(const Factor<Space>& f,
                                                   const typename Space::Pose& rel,
                                                   const typename Space::Tangent& e,
                                                   const typename Space::Tangent& xi_a,
                                                   const typename Space::Tangent& xi_b) noexcept {
  if (!is_sight(f.kind)) return Space::push_forward(f.z, rel, e, xi_a, xi_b);
  typename Space::Block by_a, by_b;
  sight_jacobians<Space>(f.kind, rel, by_a, by_b);
  return by_a * xi_a + by_b * xi_b;
}

}  // namespace maplet::measure
