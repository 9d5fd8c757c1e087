// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string_view>

#include "core/geometry/se3.hpp"
#include "core/maplet/config.hpp"

namespace maplet {

/// Why a maplet ended.
enum class CutReason : std::uint8_t {
  kNone,
  kCurvature,
  kYaw,
  kPath,
  kKeyframes,
  kBytes,
  kHidden,  ///< a surface is between the origin and the camera: the skeleton's line would cross it
  kAsked,   ///< a measurement wants an origin at its stamp
  kLost,
  kEnd
};

[[nodiscard]] constexpr std::string_view to_string(CutReason reason) noexcept {
  constexpr std::string_view kNames[] = {"none",  "curvature", "yaw",   "path", "keyframes",
                                         "bytes", "hidden",    "asked", "lost", "end"};
  return kNames[static_cast<std::size_t>(reason)];
}

/// The path inside a maplet: how long, how bent, how far turned.
///
/// Math   docs/math/maplet.md, section 3 (paper: Algorithm 1).
class CutRule {
 public:
  explicit CutRule(const MapletConfig& config) noexcept : config_{config} {}

  void start(const Se3& T_odom_origin) noexcept;
  /// Whether the path would leave the limits at this camera; does not move there.
  [[nodiscard]] CutReason check(const Se3& T_odom_camera) const noexcept;
  void go(const Se3& T_odom_camera) noexcept;

  [[nodiscard]] double path_m() const noexcept { return path_m_; }
  [[nodiscard]] double curvature_rad() const noexcept { return curvature_rad_; }

 private:
  [[nodiscard]] double bend(const Eigen::Vector3d& step) const noexcept;

  MapletConfig config_;
  Se3 origin_;
  Eigen::Vector3d at_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d corner_ = Eigen::Vector3d::Zero();   ///< where the last chord ended
  Eigen::Vector3d heading_ = Eigen::Vector3d::Zero();  ///< of the last chord; 0 = none yet
  double path_m_ = 0.0;
  double curvature_rad_ = 0.0;
};

}  // namespace maplet
