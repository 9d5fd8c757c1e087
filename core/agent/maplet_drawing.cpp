// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/agent/maplet_drawing.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace maplet {

namespace {

constexpr int kSquares = 32;  // across the image
constexpr double kNearM = 0.3;
constexpr double kFarM = 10.0;
constexpr double kNoise = 1.425e-3;  // of 1/Z of a pixel, 1/m
constexpr double kCorrelatedPx = 4.0;
constexpr double kTinyVariance = 1e-12;

// A plane of the maplet as the camera sees it.
struct Seen {
  const MapletPlane* plane;
  Eigen::Vector3d n;  // camera frame
  double d;
  Eigen::Matrix3d covariance;  // of theta
  std::int16_t index;          // in PatchSet::planes
};

// Of theta = -n/d, from that of (alpha, beta, h) about the plane's centre.
Eigen::Matrix3d theta_covariance(const MapletPlane& plane, const Se3& T_camera_maplet,
                                 const Eigen::Vector3d& n, double d) noexcept {
  const PlaneBasis basis = plane.basis();
  const Eigen::Vector3d centre = T_camera_maplet * plane.centre;
  Eigen::Matrix3d J;
  for (int i = 0; i < 2; ++i) {
    const Eigen::Vector3d axis = T_camera_maplet.q * (i == 0 ? basis.u : basis.v);
    J.col(i) = -axis / d - n * (axis.dot(centre) / (d * d));
  }
  J.col(2) = n / (d * d);
  return J * plane.covariance * J.transpose();
}

Patch square(const Seen& seen, const CameraModel& camera, int u, int v, int side) noexcept {
  Patch patch{};
  patch.theta = -seen.n / seen.d;
  const double middle = 0.5 * (side - 1.0);
  const Eigen::Vector3d ray = camera.ray(u + middle, v + middle);
  // The second moment of the rays over a square: that of its middle and its spread.
  const double pixels = static_cast<double>(side) * side;
  Eigen::Matrix3d moment = pixels * ray * ray.transpose();
  const double spread = pixels * (side * side - 1.0) / 12.0;
  moment(0, 0) += spread / (camera.fx_px * camera.fx_px);
  moment(1, 1) += spread / (camera.fy_px * camera.fy_px);
  Eigen::Matrix3d covariance = kNoise * kNoise * kCorrelatedPx * moment.inverse();
  covariance += seen.covariance;
  covariance.diagonal().array() += kTinyVariance;
  patch.information = covariance.inverse();
  patch.ray = ray.head<2>();
  patch.u_px = static_cast<std::uint16_t>(u);
  patch.v_px = static_cast<std::uint16_t>(v);
  patch.width_px = patch.height_px = static_cast<std::uint16_t>(side);
  patch.pixels = static_cast<std::uint32_t>(side * side);
  patch.rms = 1.0F;
  patch.mean_gray = -1.0F;
  patch.plane = seen.index;
  return patch;
}

}  // namespace

void draw_maplet(const Maplet& maplet, const Se3& T_maplet_camera, const CameraModel& camera,
                 PatchSet& out) noexcept {
  out.clear();
  out.camera = camera;
  const Se3 T_camera_maplet = T_maplet_camera.inverse();
  StaticVector<Seen, kMaxMapletPlanes> planes;
  for (const MapletPlane& plane : maplet.planes) {
    const Plane here = T_camera_maplet * plane.plane;
    if (here.d < kNearM * 0.1) continue;  // seen from behind, or edge-on
    planes.push_back({&plane, here.n, here.d,
                      theta_covariance(plane, T_camera_maplet, here.n, here.d), Patch::kNoPlane});
  }
  const int side = std::max(4, camera.width_px / kSquares);
  for (int v = 0; v + side <= camera.height_px && !full(out.patches); v += side) {
    for (int u = 0; u + side <= camera.width_px && !full(out.patches); u += side) {
      const Eigen::Vector3d ray = camera.ray(u + 0.5 * (side - 1.0), v + 0.5 * (side - 1.0));
      Seen* first = nullptr;
      double nearest = kFarM;
      for (Seen& seen : planes) {
        const double toward = -seen.n.dot(ray);
        if (toward <= 0.0) continue;
        const double z = seen.d / toward;
        if (z < kNearM || z >= nearest) continue;
        if (!maplet.covers(*seen.plane, T_maplet_camera * Eigen::Vector3d{z * ray})) continue;
        first = &seen;
        nearest = z;
      }
      if (first == nullptr) continue;
      if (first->index == Patch::kNoPlane && !full(out.planes)) {
        first->index = static_cast<std::int16_t>(out.planes.size());
        Eigen::Matrix3d covariance = first->covariance;
        covariance.diagonal().array() += kTinyVariance;
        out.planes.push_back({-first->n / first->d, covariance.inverse(), 0U,
                              static_cast<float>(first->plane->area_m2), 0.0F,
                              first->plane->mean_gray});
      }
      const Patch patch = square(*first, camera, u, v, side);
      if (patch.plane != Patch::kNoPlane) {
        out.planes[static_cast<std::size_t>(patch.plane)].pixels += patch.pixels;
      }
      out.valid_pixels += patch.pixels;
      out.covered_pixels += patch.pixels;
      out.patches.push_back(patch);
    }
  }
}

}  // namespace maplet
