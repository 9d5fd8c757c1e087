// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

#include "core/geometry/plane.hpp"
#include "core/geometry/se3.hpp"
#include "core/patches/patch.hpp"

namespace maplet::test {

/// A bounded rectangle: |(p - centre) . u| <= half_u and the same for v.
struct Rectangle {
  Eigen::Vector3d centre, u, v;
  double half_u, half_v;
  [[nodiscard]] Eigen::Vector3d normal() const { return u.cross(v).normalized(); }
};

/// Patch sets of a world made of rectangles, without pixels: exact planes plus Gaussian noise of
/// the covariance they claim.
class PatchScene {
 public:
  std::vector<Rectangle> rectangles;
  CameraModel camera{640, 480, 525.0, 525.0, 319.5, 239.5};
  int cell_px = 20;
  double sigma_inverse_depth = 1.425e-3;  ///< of a pixel
  double correlated_px = 4.0;
  double noise = 1.0;  ///< scales what is added, not what is claimed
  double max_range_m = 8.0;

  void add_box(const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
    const Eigen::Vector3d centre = 0.5 * (low + high);
    const Eigen::Vector3d half = 0.5 * (high - low);
    for (int axis = 0; axis < 3; ++axis) {
      const int a = (axis + 1) % 3;
      const int b = (axis + 2) % 3;
      for (const double side : {-1.0, 1.0}) {
        Rectangle face{centre + side * half[axis] * Eigen::Vector3d::Unit(axis),
                       Eigen::Vector3d::Unit(a), Eigen::Vector3d::Unit(b), half[a], half[b]};
        rectangles.push_back(face);
      }
    }
  }

  /// @return index of the rectangle and its depth along the ray (camera frame, z = 1), or -1
  [[nodiscard]] std::pair<int, double> hit(const Se3& T_world_camera,
                                           const Eigen::Vector3d& ray) const {
    const Eigen::Vector3d direction = T_world_camera.q * ray;
    int best = -1;
    double best_z = max_range_m;
    for (std::size_t i = 0; i < rectangles.size(); ++i) {
      const Rectangle& r = rectangles[i];
      const double along = r.normal().dot(direction);
      if (std::abs(along) < 1e-9) continue;
      const double z = r.normal().dot(r.centre - T_world_camera.t) / along;
      if (z < 0.3 || z >= best_z) continue;
      const Eigen::Vector3d at = T_world_camera.t + z * direction - r.centre;
      if (std::abs(at.dot(r.u)) > r.half_u || std::abs(at.dot(r.v)) > r.half_v) continue;
      best = static_cast<int>(i);
      best_z = z;
    }
    return {best, best_z};
  }

  template <class Rng>
  [[nodiscard]] PatchSet view(const Se3& T_world_camera, Rng& rng) const {
    PatchSet out;
    out.camera = camera;
    out.planes.resize(
        std::min(rectangles.size(), kMaxFramePlanes),
        FramePlane{Eigen::Vector3d::Zero(), Eigen::Matrix3d::Zero(), 0, 0.0F, 0.0F, -1.0F});
    for (int v = 0; v + cell_px <= camera.height_px; v += cell_px) {
      for (int u = 0; u + cell_px <= camera.width_px; u += cell_px) {
        add_patch(T_world_camera, u, v, rng, out);
      }
    }
    for (FramePlane& plane : out.planes) {
      if (plane.pixels > 0) plane.theta = plane.information.llt().solve(plane.theta);
    }
    return out;
  }

 private:
  /// Sum of m m' over the rays m of a cell's pixels: a ray's x is its column's, its y its row's.
  [[nodiscard]] Eigen::Matrix3d moments(int u, int v) const {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    Eigen::Vector3d squares = Eigen::Vector3d::Zero();
    for (int i = 0; i < cell_px; ++i) {
      const Eigen::Vector3d m = camera.ray(u + i, v + i);
      sum += m;
      squares += m.cwiseAbs2();
    }
    Eigen::Matrix3d out = sum * sum.transpose();
    out.diagonal() = cell_px * squares;
    return out;
  }

  template <class Rng>
  void add_patch(const Se3& T_world_camera, int u, int v, Rng& rng, PatchSet& out) const {
    if (full(out.patches)) return;
    const double last = cell_px - 1.0;
    const int id = hit(T_world_camera, camera.ray(u, v)).first;
    if (id < 0) return;
    for (const auto& [du, dv] : {std::pair{last, 0.0}, {0.0, last}, {last, last}}) {
      if (hit(T_world_camera, camera.ray(u + du, v + dv)).first != id) return;
    }
    const Rectangle& r = rectangles[static_cast<std::size_t>(id)];
    const Plane world{r.normal(), -r.normal().dot(r.centre)};
    Plane seen = T_world_camera.inverse() * world;
    if (seen.d < 0.0) seen = {-seen.n, -seen.d};
    Patch patch{};
    patch.information = moments(u, v) / (sigma_inverse_depth * sigma_inverse_depth * correlated_px);
    const Eigen::Matrix3d root = Eigen::Matrix3d{patch.information.inverse()}.llt().matrixL();
    std::normal_distribution<double> normal;
    const Eigen::Vector3d unit{normal(rng), normal(rng), normal(rng)};
    patch.theta = seen.theta() + noise * (root * unit);
    patch.ray = camera.ray(u + 0.5 * last, v + 0.5 * last).head<2>();
    patch.u_px = static_cast<std::uint16_t>(u);
    patch.v_px = static_cast<std::uint16_t>(v);
    patch.width_px = patch.height_px = static_cast<std::uint16_t>(cell_px);
    patch.pixels = static_cast<std::uint32_t>(cell_px * cell_px);
    patch.rms = 1.0F;
    patch.mean_gray = -1.0F;
    patch.plane = static_cast<std::int16_t>(id);
    FramePlane& plane = out.planes[static_cast<std::size_t>(id)];
    plane.theta += patch.information * patch.theta;
    plane.information += patch.information;
    plane.pixels += patch.pixels;
    out.patches.push_back(patch);
    out.valid_pixels += patch.pixels;
    out.covered_pixels += patch.pixels;
  }
};

/// A room of 3 x 2.6 x 5 m (y down) with some furniture; the origin inside, looking along z.
inline PatchScene room() {
  PatchScene scene;
  scene.add_box({-1.4, -1.4, -1.5}, {1.6, 1.2, 3.5});
  scene.add_box({-1.4, 0.4, 1.8}, {-0.5, 1.2, 2.6});
  scene.add_box({0.4, -0.2, 2.7}, {1.0, 1.2, 3.5});
  scene.add_box({1.1, 0.6, 1.2}, {1.6, 1.2, 2.0});
  return scene;
}

/// A corridor along z without ends, 2 m wide, 2.5 m high.
inline PatchScene corridor() {
  PatchScene scene;
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX();
  const Eigen::Vector3d y = Eigen::Vector3d::UnitY();
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  scene.rectangles = {{{-1.0, 0.0, 0.0}, y, z, 1.3, 1000.0},
                      {{1.0, 0.0, 0.0}, y, z, 1.3, 1000.0},
                      {{0.0, -1.3, 0.0}, z, x, 1000.0, 1.0},
                      {{0.0, 1.2, 0.0}, z, x, 1000.0, 1.0}};
  return scene;
}

}  // namespace maplet::test
