// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/sim/raster.hpp"

#include <algorithm>
#include <cmath>

namespace maplet::sim {
namespace {

constexpr double kNear = 0.02;  // m; nothing nearer is drawn
constexpr double kSeam = 1e-6;  // px by which surfaces overlap, so that no seam opens between two
constexpr float kDecal = 1.0F + 4e-6F;  // a decal wins over what it lies on by this
constexpr int kMaxCorners = 5;          // a rectangle cut by one plane

using Eigen::Vector3d;

/// The part of a rectangle in front of the near plane.
int clip_near(const Vector3d (&in)[4], Vector3d (&out)[kMaxCorners]) noexcept {
  int count = 0;
  for (int i = 0; i < 4; ++i) {
    const Vector3d& a = in[i];
    const Vector3d& b = in[(i + 1) % 4];
    if (a.z() >= kNear) out[count++] = a;
    if ((a.z() >= kNear) != (b.z() >= kNear)) {
      out[count++] = a + (b - a) * ((kNear - a.z()) / (b.z() - a.z()));
    }
  }
  return count;
}

/// One side of a convex polygon: bounds a row's span from the left or from the right.
struct Bound {
  double slope;   ///< px a row
  double offset;  ///< u at row 0
  bool left;
};

/// Two buffers of one row and the span to draw into them.
struct Span {
  float* inverse;
  std::int32_t* surface;
  int begin;
  int end;
};

/// Counts from the span's begin: there a grazing plane's terms have cancelled already, in double.
void fill(const Span& span, float at_begin, float step, float lift, std::int32_t index) noexcept {
  float* __restrict inverse = span.inverse;
  std::int32_t* __restrict surface = span.surface;
  for (int u = span.begin; u < span.end; ++u) {
    const float w = at_begin + step * static_cast<float>(u - span.begin);
    const bool nearer = w * lift > inverse[u];
    inverse[u] = nearer ? w : inverse[u];
    surface[u] = nearer ? index : surface[u];
  }
}

}  // namespace

Raster::Raster(const World& world, const CameraModel& camera)
    : world_{&world},
      camera_{camera},
      inverse_(static_cast<std::size_t>(camera.width_px * camera.height_px)),
      surface_(inverse_.size()),
      linear_(world.surfaces.size()),
      distance_(world.surfaces.size()) {}

void Raster::draw(const Se3& T_world_camera) noexcept {
  std::fill(inverse_.begin(), inverse_.end(), 0.0F);
  std::fill(surface_.begin(), surface_.end(), kNothing);
  const Se3 T_camera_world = T_world_camera.inverse();
  for (std::size_t i = 0; i < world_->surfaces.size(); ++i) {
    draw_surface(static_cast<std::int32_t>(i), T_camera_world);
  }
}

void Raster::draw_surface(std::int32_t index, const Se3& T_camera_world) noexcept {
  const auto i = static_cast<std::size_t>(index);
  const Surface& s = world_->surfaces[i];
  const Plane plane = T_camera_world * world_->planes[s.plane - std::size_t{1}];
  if (plane.d <= 1e-6) return;  // seen from behind
  const Vector3d corners[4] = {T_camera_world * s.corner, T_camera_world * (s.corner + s.along),
                               T_camera_world * (s.corner + s.along + s.across),
                               T_camera_world * (s.corner + s.across)};
  Vector3d polygon[kMaxCorners];
  const int count = clip_near(corners, polygon);
  if (count < 3) return;

  Eigen::Vector2d px[kMaxCorners];
  double low = camera_.height_px;
  double high = -1.0;
  double area = 0.0;
  for (int k = 0; k < count; ++k) {
    px[k] = camera_.project(polygon[k]);
    low = std::min(low, px[k].y());
    high = std::max(high, px[k].y());
  }
  for (int k = 0; k < count; ++k) {
    const auto& a = px[k];
    const auto& b = px[(k + 1) % count];
    area += a.x() * b.y() - b.x() * a.y();
  }
  const int first = static_cast<int>(std::ceil(std::max(0.0, low - kSeam)));
  const int last = static_cast<int>(std::floor(std::min(camera_.height_px - 1.0, high + kSeam)));
  if (first > last || area == 0.0) return;

  Bound bounds[kMaxCorners];
  int bound_count = 0;
  for (int k = 0; k < count; ++k) {
    const auto& a = px[k];
    const auto& b = px[(k + 1) % count];
    const double dv = b.y() - a.y();
    if (std::abs(dv) < 1e-12) continue;
    const double slope = (b.x() - a.x()) / dv;
    // Image v runs down: with positive area an edge that goes up has the inside on its right.
    bounds[bound_count++] = {slope, a.x() - slope * a.y(), (dv < 0) == (area > 0)};
  }

  const Vector3d theta = plane.theta();
  const double per_u = theta.x() / camera_.fx_px;
  const double per_v = theta.y() / camera_.fy_px;
  const double at_zero = theta.z() - per_u * camera_.cx_px - per_v * camera_.cy_px;
  linear_[i] = {static_cast<float>(per_u), static_cast<float>(per_v), static_cast<float>(at_zero)};
  distance_[i] = static_cast<float>(plane.d);
  const float lift = s.decal ? kDecal : 1.0F;
  for (int v = first; v <= last; ++v) {
    double left = 0.0;
    double right = camera_.width_px - 1.0;
    for (int k = 0; k < bound_count; ++k) {
      const double u = bounds[k].slope * v + bounds[k].offset;
      if (bounds[k].left) {
        left = std::max(left, u - kSeam);
      } else {
        right = std::min(right, u + kSeam);
      }
    }
    if (left > right) continue;
    const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(v) * camera_.width_px;
    const int begin = static_cast<int>(std::ceil(left));
    const int end = static_cast<int>(std::floor(right)) + 1;
    fill({inverse_.data() + row, surface_.data() + row, begin, end},
         static_cast<float>(at_zero + per_v * v + per_u * begin), static_cast<float>(per_u), lift,
         index);
  }
}

}  // namespace maplet::sim
