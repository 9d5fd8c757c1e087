// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
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

/// Which patch covers a pixel: one entry for each square cell of the image, row by row.
///
/// Memory  fixed: kMaxFrameCells entries.
struct PatchGrid {
  static constexpr std::int16_t kNone = -1;

  std::uint16_t cell_px = 0;  ///< edge of a cell, a power of two; 0: no grid
  std::uint16_t width = 0;    ///< in cells
  std::uint16_t height = 0;
  std::array<std::int16_t, kMaxFrameCells> patch;  ///< index into PatchSet::patches, or kNone

  [[nodiscard]] std::int16_t at_cell(int i, int j) const noexcept { return patch[j * width + i]; }
  /// Of any pixel; kNone outside the image. O(1).
  [[nodiscard]] std::int16_t at_pixel(double u_px, double v_px) const noexcept {
    if (!(u_px >= -0.5 && v_px >= -0.5) || u_px >= 65535.0 || v_px >= 65535.0) return kNone;
    if (cell_px == 0) return kNone;
    const int i = static_cast<int>(u_px + 0.5) / cell_px;
    const int j = static_cast<int>(v_px + 0.5) / cell_px;
    return i < width && j < height ? at_cell(i, j) : kNone;
  }
};

/// What the patches stage gives: both levels, patches for tracking and planes for maplets.
struct PatchSet {
  StaticVector<Patch, kMaxPatches> patches;
  StaticVector<FramePlane, kMaxFramePlanes> planes;
  PatchGrid cells;
  CameraModel camera;  ///< of the frame that was read
  Stop stop = Stop::kConverged;
  std::uint32_t valid_pixels = 0;    ///< with a return
  std::uint32_t covered_pixels = 0;  ///< on some patch

  /// The patch that covers a pixel, or nullptr. O(1).
  [[nodiscard]] const Patch* patch_at(double u_px, double v_px) const noexcept {
    const std::int16_t index = cells.at_pixel(u_px, v_px);
    return index < 0 ? nullptr : &patches[index];
  }
  /// The index of the plane that covers a pixel, or Patch::kNoPlane. O(1).
  [[nodiscard]] std::int16_t plane_at(double u_px, double v_px) const noexcept {
    const Patch* patch = patch_at(u_px, v_px);
    return patch == nullptr ? Patch::kNoPlane : patch->plane;
  }
  void clear() noexcept {
    patches.clear();
    planes.clear();
    cells.cell_px = cells.width = cells.height = 0;
    stop = Stop::kConverged;
    valid_pixels = covered_pixels = 0;
  }
};

}  // namespace maplet
