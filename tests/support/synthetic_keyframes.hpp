// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "core/odometry/keyframe.hpp"
#include "tests/support/maplets.hpp"

namespace maplet::test {

/// Index of the nearest wall that a ray meets on its seen side, or -1; its distance along the ray.
inline int cast(const std::vector<Wall>& walls, const Eigen::Vector3d& from,
                const Eigen::Vector3d& ray, double& distance) {
  int hit = -1;
  distance = 1e9;
  for (std::size_t i = 0; i < walls.size(); ++i) {
    const Wall& w = walls[i];
    const double toward = w.normal().dot(ray);
    if (toward > -1e-6) continue;
    const double s = w.normal().dot(w.centre - from) / toward;
    const Eigen::Vector3d at = from + s * ray - w.centre;
    if (s < 0.3 || s >= distance || std::abs(at.dot(w.half_a)) > w.half_a.squaredNorm() ||
        std::abs(at.dot(w.half_b)) > w.half_b.squaredNorm()) {
      continue;
    }
    hit = static_cast<int>(i);
    distance = s;
  }
  return hit;
}

/// What the patches stage would make of a perfect or noisy view of `walls`: blocks of 16 x 16
/// pixels, a frame plane for each wall.
inline void render(const std::vector<Wall>& walls, const Se3& T_world_camera, Keyframe& out,
                   std::mt19937* noise = nullptr) {
  constexpr int kBlock = 16;
  constexpr double kSigma = 2.0 * 1.425e-3;  // 1/m, neighbours correlated
  const CameraModel camera{320, 240, 262.0, 262.0, 159.5, 119.5};
  out.patches.patches.clear();
  out.patches.planes.clear();
  out.patches.camera = camera;
  PatchGrid& cells = out.patches.cells;
  cells.cell_px = kBlock;
  cells.width = static_cast<std::uint16_t>(camera.width_px / kBlock);
  cells.height = static_cast<std::uint16_t>(camera.height_px / kBlock);
  cells.patch.fill(PatchGrid::kNone);
  std::vector<int> plane_of(walls.size(), -1);
  std::vector<Eigen::Matrix3d> moments;
  std::vector<Eigen::Vector3d> thetas;
  for (int v = 0; v + kBlock <= camera.height_px; v += kBlock) {
    for (int u = 0; u + kBlock <= camera.width_px; u += kBlock) {
      int wall = -2;
      double s = 0.0;
      for (int k = 0; k < 4; ++k) {
        const Eigen::Vector3d ray =
            camera.ray(u + (k & 1) * (kBlock - 1), v + (k >> 1) * (kBlock - 1));
        const int hit = cast(walls, T_world_camera.t, T_world_camera.q * ray, s);
        wall = wall == -2 || wall == hit ? hit : -1;
      }
      if (wall < 0) continue;
      const Wall& w = walls[wall];
      Plane plane;
      plane.n = T_world_camera.q.conjugate() * w.normal();
      plane.d = -plane.n.dot(T_world_camera.inverse() * w.centre);
      if (plane_of[wall] < 0) {
        plane_of[wall] = static_cast<int>(moments.size());
        moments.push_back(Eigen::Matrix3d::Zero());
        thetas.push_back(plane.theta());
      }
      Patch p{};
      p.theta = plane.theta();
      p.ray = camera.ray(u + 0.5 * (kBlock - 1), v + 0.5 * (kBlock - 1)).head<2>();
      Eigen::Matrix3d m = Eigen::Matrix3d::Zero();
      for (int k = 0; k < kBlock * kBlock; ++k) {
        const Eigen::Vector3d ray = camera.ray(u + k % kBlock, v + k / kBlock);
        m += ray * ray.transpose();
      }
      p.information = m / (kSigma * kSigma);
      moments[plane_of[wall]] += p.information;
      p.u_px = static_cast<std::uint16_t>(u);
      p.v_px = static_cast<std::uint16_t>(v);
      p.width_px = p.height_px = kBlock;
      p.pixels = kBlock * kBlock;
      p.mean_gray = 80.0F;
      p.plane = static_cast<std::int16_t>(plane_of[wall]);
      cells.patch[static_cast<std::size_t>(v / kBlock * cells.width + u / kBlock)] =
          static_cast<std::int16_t>(out.patches.patches.size());
      out.patches.patches.push_back(p);
    }
  }
  std::normal_distribution<double> normal;
  for (std::size_t i = 0; i < moments.size(); ++i) {
    FramePlane f{};
    f.theta = thetas[i];
    f.information = moments[i];
    if (noise != nullptr) {
      const Eigen::Matrix3d root = moments[i].inverse().llt().matrixL();
      f.theta += root * Eigen::Vector3d{normal(*noise), normal(*noise), normal(*noise)};
    }
    f.mean_gray = 80.0F;
    const Plane plane = f.plane();
    for (Patch& p : out.patches.patches) {
      if (p.plane != static_cast<int>(i)) continue;
      f.pixels += p.pixels;
      const Eigen::Vector3d centre = p.centre();
      const double slant = -plane.n.dot(centre) / centre.norm();
      f.area_m2 += static_cast<float>(p.pixels * std::pow(centre.z() / camera.fx_px, 2) / slant);
      p.theta = f.theta;
    }
    out.patches.planes.push_back(f);
  }
}

}  // namespace maplet::test
