// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "core/skeleton/measure.hpp"
#include "tools/solve/words.hpp"

/// Between a file's numbers and the two spaces of the engine.
namespace maplet::graphs {

inline Se2 to_pose(const Se3& p, PlanarSpace) {
  return Se2::from(p.t.x(), p.t.y(), 2.0 * std::atan2(p.q.z(), p.q.w()));
}
inline Se3 to_pose(const Se3& p, SpatialSpace) { return p; }
inline Se3 from_pose(const Se2& p) {
  const double half = 0.5 * p.angle();
  return {Eigen::Quaterniond{std::cos(half), 0.0, 0.0, std::sin(half)}, {p.x, p.y, 0.0}};
}
inline Se3 from_pose(const Se3& p) { return p; }

/// What an edge measures, as a factor holds it.
inline Se2 measured(const Edge& e, PlanarSpace) {
  if (!measure::is_sight(e.kind)) return to_pose(e.z, PlanarSpace{});
  if (e.kind == FactorKind::kPosition) return measure::make_position(e.z.t.head<2>().eval());
  return measure::make_sight(e.range_m, e.bearing_rad, PlanarSpace{});
}
inline Se3 measured(const Edge& e, SpatialSpace) {
  if (!measure::is_sight(e.kind)) return e.z;
  if (e.kind == FactorKind::kPosition) return measure::make_position(e.z.t);
  return measure::make_sight(e.range_m, Eigen::Vector3d::UnitX(), SpatialSpace{});
}

inline Eigen::Matrix3d information(const Edge& e, PlanarSpace) {
  if (measure::is_sight(e.kind)) return e.information.topLeftCorner<3, 3>();
  Eigen::Matrix3d out;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) out(r, c) = e.information(kPlanar[r], kPlanar[c]);
  return out;
}
inline Matrix6d information(const Edge& e, SpatialSpace) { return e.information; }

inline void put_information(const Eigen::Matrix3d& from, Edge& e) {
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) e.information(kPlanar[r], kPlanar[c]) = from(r, c);
}
inline void put_information(const Matrix6d& from, Edge& e) { e.information = from; }

/// Where a sight says that its target is, in the frame of who sees it; ranges do not say.
inline bool tells_position(FactorKind kind) {
  return kind == FactorKind::kPosition || kind == FactorKind::kRangeBearing;
}
inline Se2 position_of(const Edge& e, PlanarSpace) {
  if (e.kind == FactorKind::kPosition) return {e.z.t.x(), e.z.t.y(), 1.0, 0.0};
  return {e.range_m * std::cos(e.bearing_rad), e.range_m * std::sin(e.bearing_rad), 1.0, 0.0};
}
inline Se3 position_of(const Edge& e, SpatialSpace) { return measure::make_position(e.z.t); }

}  // namespace maplet::graphs
