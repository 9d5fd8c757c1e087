// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/odometry/free_space.hpp"

#include <algorithm>
#include <cmath>

namespace maplet {

namespace {

// Of inverse depth: the same surface. Near ones are known best; what moves may have come nearer.
constexpr double kSame = 0.1;
constexpr double kSameNear = 0.04;
constexpr double kSamePerM = 0.02;
constexpr double kHangs = 0.15;  // the same: one body
// A pose that is wrong marks much at once; a body comes in by and by.
constexpr double kMostMoves = 0.5;
constexpr double kMostNew = 0.15;
constexpr double kMostEver = 0.85;
constexpr int kSweeps = 2;
constexpr int kFramesToStand = 5;
constexpr double kStayed = 0.02;  // of inverse depth: a body walks out of that in these frames
constexpr double kMostFresh = 0.7;
constexpr double kNear = 0.8;  // times the mean depth of what is known

enum class Seen { kNothing, kThrough, kOnMoved, kOnStill };

// What a view says of a point (its camera's frame).
struct Look {
  Seen seen = Seen::kNothing;
  Facet* facet = nullptr;  // of the view, there
  double off = 0.0;        // share of inverse depth
};
Look look(PatchView& view, const Eigen::Vector3d& point) noexcept {
  const int found = view.at(point);
  if (found == PatchView::kNone) return {};
  Facet& facet = view.facets()[static_cast<std::size_t>(found)];
  const double off = facet.theta.dot(point) - 1.0;
  const double same = facet.moved ? kSame : std::clamp(kSamePerM * point.z(), kSameNear, kSame);
  if (std::abs(off) < same) return {facet.moved ? Seen::kOnMoved : Seen::kOnStill, &facet, off};
  if (off < 0.0 && view.sees_through(point)) return {Seen::kThrough, &facet, off};
  return {};
}

// A keyframe that knows some of what the frame sees.
struct Witness {
  PatchView* view;
  Se3 T_view_frame;
  bool old;  // enough that what moves would have moved away since
};
using Witnesses = StaticVector<Witness, PatchAligner::kMaxReferences>;

void ask(Facet& facet, std::span<const Witness> witnesses) noexcept {
  bool through = false;
  bool on_moved = false;
  bool on_still = false;
  bool on_known = false;
  for (const Witness& witness : witnesses) {
    const Look at = look(*witness.view, witness.T_view_frame * facet.centre);
    through = through || at.seen == Seen::kThrough;
    on_moved = on_moved || at.seen == Seen::kOnMoved;
    if (at.seen != Seen::kOnStill) continue;
    on_still = true;
    if (witness.old && std::abs(at.off) < kStayed) at.facet->fresh = false;
    on_known = on_known || !at.facet->fresh;
  }
  facet.moved = through || (on_moved && !on_still);
  facet.stood = on_still && !through;
  facet.fresh = !facet.moved && !on_known;
}

// Marks what of `facets` is seen through from a view in which T_view_facets places them.
// @return pixels on them
double pixels_through(std::span<const Facet> facets, PatchView& view,
                      const Se3& T_view_facets) noexcept {
  double pixels = 0.0;
  for (const Facet& facet : facets) {
    if (look(view, T_view_facets * facet.centre).seen == Seen::kThrough) pixels += facet.pixels;
  }
  return pixels;
}

void mark_through(std::span<Facet> facets, PatchView& view, const Se3& T_view_facets) noexcept {
  for (Facet& facet : facets) {
    if (look(view, T_view_facets * facet.centre).seen == Seen::kThrough) facet.moved = true;
  }
}

double pixels_moved(const PatchView& frame) noexcept {
  double pixels = 0.0;
  for (const Facet& facet : frame.facets()) pixels += facet.moved ? facet.pixels : 0.0;
  return pixels;
}

// Only what is nearer than the known surfaces can outweigh them (information falls with the fourth
// power of depth); the rest may be new, but is not weaker for it. Without enough to hold on to
// everything counts alike.
void trust_what_is_far(PatchView& frame) noexcept {
  double known = 0.0;
  double known_depth_m = 0.0;
  for (const Facet& facet : frame.facets()) {
    if (facet.moved || facet.fresh) continue;
    known += facet.pixels;
    known_depth_m += facet.pixels * facet.centre.z();
  }
  double fresh = 0.0;
  for (Facet& facet : frame.facets()) {
    if (facet.centre.z() * known > kNear * known_depth_m) facet.fresh = false;
    if (facet.fresh) fresh += facet.pixels;
  }
  if (fresh > kMostFresh * (fresh + known)) trust_all(frame);
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

void trust_all(PatchView& frame) noexcept {
  for (Facet& facet : frame.facets()) facet.fresh = false;
}

void carry_marks(PatchView& frame, const PatchView& before) noexcept {
  for (Facet& facet : frame.facets()) {
    const int found = before.at(facet.centre);
    if (found == PatchView::kNone) continue;
    const Facet& other = before.facets()[static_cast<std::size_t>(found)];
    facet.moved = other.moved && std::abs(other.theta.dot(facet.centre) - 1.0) < kHangs;
  }
}

double mark_what_moves(PatchView& frame, std::span<const Reference> keyframes,
                       const Se3& T_odom_camera, double before) noexcept {
  const double most = std::clamp(before + kMostNew, kMostMoves, kMostEver);
  for (const Reference& keyframe : keyframes) {
    const Se3 T_frame_keyframe = (keyframe.T_reference_odom * T_odom_camera).inverse();
    const double gone = pixels_through(keyframe.view->facets(), frame, T_frame_keyframe);
    if (gone > most * keyframe.view->pixels()) return 0.0;
    if (gone > 0.0) mark_through(keyframe.view->facets(), frame, T_frame_keyframe);
  }
  Witnesses witnesses;
  for (const Reference& keyframe : keyframes) {
    witnesses.push_back({keyframe.view, keyframe.T_reference_odom * T_odom_camera,
                         keyframe.view->count_frame() > kFramesToStand});
  }
  for (Facet& facet : frame.facets()) ask(facet, {witnesses.data(), witnesses.size()});
  trust_what_is_far(frame);
  const double moving = pixels_moved(frame);
  if (moving == 0.0) return 0.0;
  if (moving <= most * frame.pixels()) {
    mark_what_hangs_on(frame);
    return pixels_moved(frame) / frame.pixels();
  }
  for (Facet& facet : frame.facets()) facet.moved = false;
  return 0.0;
}

}  // namespace maplet
