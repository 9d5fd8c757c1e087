// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/maplet/up_finder.hpp"

#include <cmath>
#include <utility>

namespace maplet {

namespace {

constexpr double kLeastArea_m2 = 0.4;  // of the dominant plane
constexpr double kFound_rad = 0.6;     // from where up is expected while nothing is known
constexpr double kFollowed_rad = 0.17;
constexpr double kSamePlane = 0.996;  // cosine, 5 deg: planes that are averaged
constexpr double kGain = 0.2;         // of a view, on what is known

}  // namespace

Eigen::Vector3d up_of(const PatchSet& set, const Eigen::Vector3d& expected,
                      double within_rad) noexcept {
  const double least_cosine = std::cos(within_rad);
  const FramePlane* dominant = nullptr;
  for (const FramePlane& p : set.planes) {
    if (std::abs(p.plane().n.dot(expected)) < least_cosine) continue;
    if (dominant == nullptr || p.area_m2 > dominant->area_m2) dominant = &p;
  }
  if (dominant == nullptr || dominant->area_m2 < kLeastArea_m2) return Eigen::Vector3d::Zero();
  const Eigen::Vector3d n = dominant->plane().n;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const FramePlane& p : set.planes) {
    const Eigen::Vector3d other = p.plane().n;
    const double cosine = other.dot(n);
    if (std::abs(cosine) > kSamePlane) sum += std::copysign(p.area_m2, cosine) * other;
  }
  return (n.dot(expected) < 0.0 ? -1.0 : 1.0) * sum.normalized();
}

std::string_view to_string(UpSource source) noexcept {
  constexpr std::string_view kNames[] = {"given", "floor", "mounting", "mission"};
  return kNames[static_cast<std::size_t>(source)];
}

FirstUp first_up(const PatchSet& view, const Mounting& mounting) noexcept {
  if (const auto& up = mounting.up) {
    return {Eigen::Vector3d{(*up)[0], (*up)[1], (*up)[2]}.normalized(), UpSource::kGiven};
  }
  const Eigen::Vector3d found = up_of(view, mounting.expected, kFound_rad);
  if (found.isZero()) return {mounting.expected, UpSource::kMounting};
  return {found, UpSource::kFloor};
}

UpFinder::UpFinder(const Mounting& mounting) noexcept : up_odom_{mounting.expected} {
  const auto& up = mounting.up;
  if (!up) return;
  up_odom_ = Eigen::Vector3d{(*up)[0], (*up)[1], (*up)[2]}.normalized();
  known_ = true;
}

void UpFinder::look(const Keyframe& keyframe) noexcept {
  if (!std::exchange(started_, true)) up_odom_ = keyframe.T_odom_camera.se3.q * up_odom_;
  if (keyframe.segment != segment_) known_ = false;  // the turn of the gap is not known
  segment_ = keyframe.segment;
  const Eigen::Quaterniond& q = keyframe.T_odom_camera.se3.q;
  const Eigen::Vector3d seen =
      q * up_of(keyframe.patches, q.conjugate() * up_odom_, known_ ? kFollowed_rad : kFound_rad);
  if (seen.isZero()) return;
  up_odom_ = known_ ? Eigen::Vector3d{(up_odom_ + kGain * seen).normalized()} : seen;
  known_ = true;
}

Eigen::Vector3d UpFinder::at(const Se3& T_odom_camera) const noexcept {
  return known_ ? Eigen::Vector3d{T_odom_camera.q.conjugate() * up_odom_} : Eigen::Vector3d::Zero();
}

}  // namespace maplet
