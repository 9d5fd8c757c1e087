// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/mounting.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "daemon/pose_text.hpp"

namespace maplet::daemon {

Mounting mounting_of(const Se3& T_body_camera, const Vector3OrAuto& up) noexcept {
  return {up, T_body_camera.q.conjugate() * Eigen::Vector3d::UnitZ()};
}

Mounting mounting_of(const BodyConfig& body) {
  return mounting_of(pose_of(body.T_body_camera).value_or(Se3{}), body.up);
}

std::string mounting_doubt(const BodyConfig& body) {
  constexpr double kApart_rad = 1.0;
  const Mounting mounting = mounting_of(body);
  if (!mounting.up) return {};
  const auto& [x, y, z] = *mounting.up;
  const Eigen::Vector3d up = Eigen::Vector3d{x, y, z}.normalized();
  const double apart_rad = std::acos(std::clamp(up.dot(mounting.expected), -1.0, 1.0));
  if (apart_rad < kApart_rad) return {};
  return fmt::format(
      "body.up = [{}, {}, {}] is {:.0f} deg from where body.T_body_camera has it: up is a "
      "direction "
      "in the camera's frame (x right, y down, z forward), [0, -1, 0] of a level camera",
      x, y, z, apart_rad * 57.29577951308232);
}

Line plane_doubt(const std::optional<PlaneHold::Report>& plane) noexcept {
  constexpr std::uint64_t kFew = 100;
  constexpr std::uint64_t kOften = 20;  // one frame of so many
  constexpr double kTilted_rad = 0.014;
  if (!plane) return {};
  if (plane->of >= kFew && plane->off * kOften > plane->of) {
    return line(
        "motion = planar, but {} of {} frames were seen more than {:.0f} cm or {:.1f} deg off the "
        "plane since their keyframe: it climbs (motion = 3d), or body.up is wrong",
        plane->off, plane->of, PlaneHold::Report::kOff_m * 100.0,
        PlaneHold::Report::kOff_rad * 57.29577951308232);
  }
  if (plane->floor_off_rad > kTilted_rad) {
    const bool goes_on = plane->from == UpSource::kMission;
    return line("motion = planar, but the floor that the first view shows is {:.1f} deg from {}",
                plane->floor_off_rad * 57.29577951308232,
                goes_on ? "the plane of the mission's maplets: the camera sits otherwise now"
                        : "body.up: measure it again, or leave it to auto");
  }
  if (plane->from == UpSource::kMounting) {
    return line(
        "motion = planar, but the first view shows no floor within 34 deg of where "
        "body.T_body_camera expects it: taken from there; body.up would say it");
  }
  return {};
}

}  // namespace maplet::daemon
