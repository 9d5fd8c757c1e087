// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/odometry/free_space.hpp"

#include <cmath>

namespace maplet {

namespace {

constexpr double kSame = 0.1;    // of inverse depth: the same surface
constexpr double kHangs = 0.15;  // the same: one body
constexpr double kMostMoves = 0.5;
constexpr int kSweeps = 2;

enum class Seen { kNothing, kThrough, kOnMoved, kOnStill };

// What a view says of a point (its camera's frame).
Seen look(const PatchView& view, const Eigen::Vector3d& point) noexcept {
  const int found = view.at(point);
  if (found == PatchView::kNone) return Seen::kNothing;
  const Facet& facet = view.facets()[static_cast<std::size_t>(found)];
  const double there = facet.theta.dot(point);
  if (std::abs(there - 1.0) < kSame) return facet.moved ? Seen::kOnMoved : Seen::kOnStill;
  return there < 1.0 && view.sees_through(point) ? Seen::kThrough : Seen::kNothing;
}

// Marks what of `facets` is seen through from a view in which T_view_facets places them.
// @return pixels on them
double pixels_through(std::span<const Facet> facets, const PatchView& view,
                      const Se3& T_view_facets) noexcept {
  double pixels = 0.0;
  for (const Facet& facet : facets) {
    if (look(view, T_view_facets * facet.centre) == Seen::kThrough) pixels += facet.pixels;
  }
  return pixels;
}

void mark_through(std::span<Facet> facets, const PatchView& view,
                  const Se3& T_view_facets) noexcept {
  for (Facet& facet : facets) {
    if (look(view, T_view_facets * facet.centre) == Seen::kThrough) facet.moved = true;
  }
}

// What no keyframe knows moves with what it hangs together with.
void mark_what_hangs_on(PatchView& frame) noexcept {
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    for (Facet& facet : frame.facets()) {
      if (facet.moved || facet.stood) continue;
      for (const int found : frame.beside(facet)) {
        if (found == PatchView::kNone) continue;
        const Facet& other = frame.facets()[static_cast<std::size_t>(found)];
        if (other.moved && std::abs(other.theta.dot(facet.centre) - 1.0) < kHangs) {
          facet.moved = true;
        }
      }
    }
  }
}

}  // namespace

double mark_what_moves(PatchView& frame, std::span<const Reference> keyframes,
                       const Se3& T_odom_camera) noexcept {
  for (const Reference& keyframe : keyframes) {
    const Se3 T_frame_keyframe = (keyframe.T_reference_odom * T_odom_camera).inverse();
    const double gone = pixels_through(keyframe.view->facets(), frame, T_frame_keyframe);
    if (gone > kMostMoves * keyframe.view->pixels()) return 0.0;
    if (gone > 0.0) mark_through(keyframe.view->facets(), frame, T_frame_keyframe);
  }
  double moving = 0.0;
  for (Facet& facet : frame.facets()) {
    bool through = false;
    bool on_moved = false;
    bool on_still = false;
    for (const Reference& keyframe : keyframes) {
      const Seen seen =
          look(*keyframe.view, keyframe.T_reference_odom * (T_odom_camera * facet.centre));
      through = through || seen == Seen::kThrough;
      on_moved = on_moved || seen == Seen::kOnMoved;
      on_still = on_still || seen == Seen::kOnStill;
    }
    facet.moved = through || (on_moved && !on_still);
    facet.stood = on_still && !through;
    if (facet.moved) moving += facet.pixels;
  }
  if (moving == 0.0) return 0.0;
  if (moving <= kMostMoves * frame.pixels()) {
    mark_what_hangs_on(frame);
    moving = 0.0;
    for (const Facet& facet : frame.facets()) moving += facet.moved ? facet.pixels : 0.0;
    return moving / frame.pixels();
  }
  for (Facet& facet : frame.facets()) facet.moved = false;
  return 0.0;
}

}  // namespace maplet
