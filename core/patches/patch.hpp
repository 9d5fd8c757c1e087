// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "core/base/deadline.hpp"
#include "core/base/static_vector.hpp"
#include "core/geometry/camera_model.hpp"
#include "core/geometry/plane.hpp"
#include "core/limits.hpp"

namespace maplet {

/// A flat piece of one depth frame: a quadtree node with its plane.
///
/// theta . (x/Z, y/Z, 1) = 1/Z, in the camera's frame; its covariance is information^-1, calibrated
/// for correlated noise (docs/math/patches.md).
struct Patch {
  Eigen::Vector3d theta;        ///< 1/m
  Eigen::Matrix3d information;  ///< of theta, m^2
  Eigen::Vector2d ray;          ///< mean (x/Z, y/Z) of its pixels
  std::uint16_t u_px, v_px;     ///< top left pixel
  std::uint16_t width_px, height_px;
  std::uint32_t pixels;  ///< valid ones
  float rms;             ///< of the residual of 1/Z, in standard deviations of the noise
  float mean_gray;       ///< 0..255; negative when there is no gray image
  std::int16_t plane;    ///< index into PatchSet::planes, or kNoPlane

  static constexpr std::int16_t kNoPlane = -1;

  /// The centre of its pixels on the plane, camera frame, m.
  [[nodiscard]] Eigen::Vector3d centre() const noexcept {
    const Eigen::Vector3d m{ray.x(), ray.y(), 1.0};
    return m / theta.dot(m);
  }
};

/// A plane of one depth frame: patches that are connected and flat together.
struct FramePlane {
  Eigen::Vector3d theta;        ///< 1/m
  Eigen::Matrix3d information;  ///< of theta, m^2
  std::uint32_t pixels;
  float area_m2;
  float rms_m;      ///< of the distance of its pixels to the plane
  float mean_gray;  ///< 0..255; negative when there is no gray image

  [[nodiscard]] Plane plane() const noexcept { return Plane::from_theta(theta); }
};

/// What the patches stage gives: both levels, patches for tracking and planes for maplets.
struct PatchSet {
  StaticVector<Patch, kMaxPatches> patches;
  StaticVector<FramePlane, kMaxFramePlanes> planes;
  CameraModel camera;  ///< of the frame that was read
  Stop stop = Stop::kConverged;
  std::uint32_t valid_pixels = 0;    ///< with a return
  std::uint32_t covered_pixels = 0;  ///< on some patch
};

}  // namespace maplet
