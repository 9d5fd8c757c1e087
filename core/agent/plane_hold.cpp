// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/agent/plane_hold.hpp"

#include <algorithm>
#include <cmath>

namespace maplet {

namespace {

constexpr double kFloor_rad = 0.17;  // further from what was given it is something else

}  // namespace

const PlanarMotion& PlaneHold::fix(const PatchSet& first_view) noexcept {
  const FirstUp first = first_up(first_view, mounting_);
  if (from_ != UpSource::kMission) from_ = first.from;
  if (first.from == UpSource::kGiven) {
    const Eigen::Vector3d floor = up_of(first_view, first.up, kFloor_rad);
    if (!floor.isZero()) floor_off_rad_ = std::acos(std::clamp(floor.dot(first.up), -1.0, 1.0));
  }
  return planar_.emplace(first.up);
}

void PlaneHold::go_on(const Eigen::Vector3d& up) noexcept {
  if (planar_ || mounting_.up || up.isZero()) return;
  mounting_.up = std::array{up.x(), up.y(), up.z()};
  from_ = UpSource::kMission;
}

void PlaneHold::hold(Track& track) noexcept {
  if (!planar_) return;
  if (track.state == Track::State::kTracking) {
    const Se3& seen = track.T_keyframe_camera.se3;
    const Se3 off = planar_->project(seen).inverse() * seen;
    off_ += off.t.norm() > Report::kOff_m || off.angle() > Report::kOff_rad ? 1 : 0;
    ++of_;
  }
  const Se3 T_odom_keyframe = track.T_odom_camera.se3 * track.T_keyframe_camera.se3.inverse();
  const auto held = planar_->condition(track.T_keyframe_camera.se3, track.covariance);
  track.T_keyframe_camera.se3 = held.T;
  track.covariance = held.covariance;
  track.T_odom_camera.se3 = planar_->project(T_odom_keyframe * held.T);
}

std::optional<PlaneHold::Report> PlaneHold::report() const noexcept {
  if (!planar_) return std::nullopt;
  return Report{planar_->up(), from_, floor_off_rad_, off_, of_};
}

}  // namespace maplet
