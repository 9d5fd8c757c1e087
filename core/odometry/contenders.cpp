// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/odometry/contenders.hpp"

#include <algorithm>

namespace maplet {

namespace {

constexpr int kVotes = 4;       // to win
constexpr int kTimesAhead = 3;  // of the next one
constexpr int kIdleFrames = 60;
constexpr double kMovedM = 0.2;
constexpr double kMovedRad = 0.15;
// From frame to frame, of a camera whose motion is not known; more lies between two places.
constexpr double kSameM = 0.2;
constexpr double kSameRad = 0.2;

}  // namespace

bool Contenders::same(const Contender& contender, const Place& place) noexcept {
  const Se3 apart = contender.place.T_odom_camera.inverse() * place.T_odom_camera;
  return contender.place.segment == place.segment && apart.t.norm() < kSameM &&
         apart.angle() < kSameRad;
}

void Contenders::step(const Se3& T_last_now) noexcept {
  for (Contender& c : places_) {
    c.place.T_odom_camera = c.place.T_odom_camera * T_last_now;
    ++c.idle;
  }
  places_.erase(std::remove_if(places_.begin(), places_.end(),
                               [](const Contender& c) { return c.idle > kIdleFrames; }),
                places_.end());
}

void Contenders::vote(const Place& place) noexcept {
  for (Contender& c : places_) {
    if (!same(c, place)) continue;
    c.place = place;
    if (c.idle > 0) ++c.votes;
    c.idle = 0;
    return;
  }
  if (full(places_)) {
    places_.erase(std::min_element(places_.begin(), places_.end(), has_fewer_votes));
  }
  places_.push_back({place, place.T_odom_camera, 1, 0});
}

bool Contenders::won(const Place& place) const noexcept {
  const auto best = std::max_element(places_.begin(), places_.end(), has_fewer_votes);
  if (best == places_.end() || best->votes < kVotes || !same(*best, place)) return false;
  const Se3 moved = best->T_odom_first.inverse() * place.T_odom_camera;
  if (!place.near && moved.t.norm() < kMovedM && moved.angle() < kMovedRad) return false;
  return std::all_of(places_.begin(), places_.end(), [&](const Contender& c) {
    return &c == &*best || kTimesAhead * c.votes <= best->votes;
  });
}

}  // namespace maplet
