// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/registration/saliency.hpp"

#include <algorithm>
#include <cmath>

namespace maplet {

namespace {
constexpr float kSmall = 1.0F;     // root of an area: below it a plane is no wall or floor
constexpr double kDetail_m = 4.0;  // of small planes that make a place well known
constexpr double kSame_m = 0.3;    // from itself
constexpr double kSame_rad = 0.2;
}  // namespace

double Saliency::of(const Maplet& maplet) noexcept {
  PlaceDescriptor::describe(maplet, place_);
  if (place_.axes.size() < 3) return 0.0;  // some direction is free
  double detail = 0.0;
  for (const PlacePlane& p : place_.planes) detail += p.weight < kSmall ? p.weight : 0.0;
  float itself = 0.0F;
  float elsewhere = 0.0F;
  for (const PlaceGuess& g : compare_.guess(place_, place_)) {
    const bool same = g.T_a_b.t.norm() < kSame_m && g.T_a_b.angle() < kSame_rad;
    float& score = same ? itself : elsewhere;
    score = std::max(score, g.score);
  }
  if (itself <= 0.0F) return 0.0;
  const double unique = std::max(0.0, 1.0 - static_cast<double>(elsewhere / itself));
  return unique * (1.0 - std::exp(-detail / kDetail_m));
}

}  // namespace maplet
