// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/odometry/telling.hpp"

#include <algorithm>
#include <cmath>

namespace maplet {

namespace {

constexpr std::size_t kProbes = 48;
constexpr double kBehind = 1.1;        // times the depth at which the surface would be
constexpr double kBehindShare = 0.03;  // of the view's pixels
constexpr double kSame = 0.04;         // of inverse depth
constexpr double kSameCosine = 0.94;   // of normals
constexpr double kLeastShare = 0.03;   // of the view's pixels must tell something
constexpr double kLeastAgreement = 0.8;

// Whether the view shows something behind the surface: no wall of a plain room.
bool stands_in_front(const PatchView& view, const Facet& facet) noexcept {
  double behind = 0.0;
  double all = 0.0;
  const std::size_t stride = 1 + view.facets().size() / kProbes;
  for (std::size_t i = 0; i < view.facets().size(); i += stride) {
    const Facet& probe = view.facets()[i];
    all += probe.pixels;
    if (dot(facet.surface, probe.centre) > kBehind) behind += probe.pixels;
  }
  return behind > kBehindShare * all;
}

struct Tally {
  double all = 0.0;
  double landed = 0.0;
  double agreed = 0.0;
};

// What of `from` stands in front of something, and whether `to` has it in the same place.
Tally compare(const PatchView& from, const PatchView& to, const Se3& T_to_from) noexcept {
  Tally tally;
  const Eigen::Matrix3d R = T_to_from.rotation();
  for (const Facet& facet : from.facets()) {
    tally.all += facet.pixels;
    if (!stands_in_front(from, facet)) continue;
    const Eigen::Vector3d point = times(R, facet.centre) + T_to_from.t;
    const int found = to.at(point);
    if (found == PatchView::kNone) continue;
    const Facet& other = to.facets()[static_cast<std::size_t>(found)];
    const double there = dot(other.theta, point);
    if (there > 1.0 + kSame) continue;  // hidden behind something nearer
    tally.landed += facet.pixels;
    const Eigen::Vector3d normal = times(R, facet.surface);
    const double cosine = dot(normal, other.surface) / (normal.norm() * other.surface.norm());
    if (there > 1.0 - kSame && cosine > kSameCosine) tally.agreed += facet.pixels;
  }
  return tally;
}

bool agrees(const Tally& tally) noexcept {
  return tally.agreed > kLeastShare * tally.all && tally.agreed > kLeastAgreement * tally.landed;
}

}  // namespace

bool telling(const PatchView& a, const PatchView& b, const Se3& T_a_b) noexcept {
  return agrees(compare(b, a, T_a_b)) && agrees(compare(a, b, T_a_b.inverse()));
}

}  // namespace maplet
