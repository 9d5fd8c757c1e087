// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// How well the planes of two maplets coincide under a transform, and the best of those tried.
#include <algorithm>
#include <cmath>

#include "core/registration/place_compare.hpp"

namespace maplet {

namespace {

constexpr float kPlaneCosine = 0.966F;  // planes that may coincide
constexpr float kPlaneGate_m = 0.12F;
constexpr float kSame_m = 0.25F;  // guesses closer than that are one

// Share of the smaller rectangle that lies on the larger one: by nine points of it.
float shared(const PlacePlane& a, const Eigen::Vector3f& centre, const Eigen::Vector3f& u,
             const Eigen::Vector3f& v, float half_u, float half_v) noexcept {
  constexpr float kSlack_m = 0.1F;
  const Eigen::Vector3f v_a = a.n.cross(a.u);
  const Eigen::Vector3f from = centre - a.centre;
  const Eigen::Vector3f along_u = 0.6F * half_u * u;
  const Eigen::Vector3f along_v = 0.6F * half_v * v;
  const Eigen::Vector2f at{from.dot(a.u), from.dot(v_a)};
  const Eigen::Vector2f du{along_u.dot(a.u), along_u.dot(v_a)};
  const Eigen::Vector2f dv{along_v.dot(a.u), along_v.dot(v_a)};
  const Eigen::Vector2f limit{a.half_u_m + kSlack_m, a.half_v_m + kSlack_m};
  int on = 0;
  for (const float s : {-1.0F, 0.0F, 1.0F}) {
    for (const float t : {-1.0F, 0.0F, 1.0F}) {
      const Eigen::Vector2f p = at + s * du + t * dv;
      on += static_cast<int>(std::abs(p.x()) <= limit.x()) &
            static_cast<int>(std::abs(p.y()) <= limit.y());
    }
  }
  return static_cast<float>(on) / 9.0F;
}

}  // namespace

// The same turn is tried with many shifts.
void PlaceCompare::turn_planes(const Eigen::Matrix3f& R) noexcept {
  turned_.clear();
  for (const PlacePlane& pb : b_->planes) {
    Turned& turned = turned_.emplace_back();
    turned.n = R * pb.n;
    turned.u = R * pb.u;
    turned.v = turned.n.cross(turned.u);
    turned.centre = R * pb.centre;
    for (std::size_t ia = 0; ia < a_->planes.size(); ++ia) {
      const PlacePlane& pa = a_->planes[ia];
      if (pa.n.dot(turned.n) < kPlaneCosine) continue;
      turned.along.push_back({static_cast<std::uint8_t>(ia), pa.distance(turned.centre)});
    }
  }
}

// Planes that coincide, by where their rectangles are.
float PlaceCompare::score(const Eigen::Vector3f& t) const noexcept {
  float sum = 0.0F;
  for (std::size_t ib = 0; ib < turned_.size(); ++ib) {
    const PlacePlane& pb = b_->planes[ib];
    const Turned& turned = turned_[ib];
    float best = 0.0F;
    for (const Turned::Along& along : turned.along) {
      const PlacePlane& pa = a_->planes[along.of_a];
      const float least = std::min(pa.weight, pb.weight);
      if (least <= best) continue;
      const float off = std::abs(along.off_m + pa.n.dot(t));
      if (off > kPlaneGate_m) continue;
      const Eigen::Vector3f centre = turned.centre + t;
      const bool b_smaller = pb.half_u_m * pb.half_v_m <= pa.half_u_m * pa.half_v_m;
      const float share = b_smaller
                              ? shared(pa, centre, turned.u, turned.v, pb.half_u_m, pb.half_v_m)
                              : shared({turned.n, turned.u, centre, pb.half_u_m, pb.half_v_m, 0.0F},
                                       pa.centre, pa.u, pa.n.cross(pa.u), pa.half_u_m, pa.half_v_m);
      best = std::max(best, share * least * (1.0F - 0.5F * off / kPlaneGate_m));
    }
    sum += best;
  }
  return sum / std::max(1e-6F, std::min(a_->weight, b_->weight));
}

// Scores a transform and puts it among the best, one of each kind.
void PlaceCompare::keep(const Eigen::Matrix3f& R, const Eigen::Vector3f& t,
                        Guesses& out) const noexcept {
  PlaceGuess guess;
  guess.score = score(t);
  if (full(out) && guess.score <= out.back().score) return;
  guess.T_a_b = {Eigen::Quaterniond{R.cast<double>()}.normalized(), t.cast<double>()};
  const auto same = std::find_if(out.begin(), out.end(), [&](const PlaceGuess& g) {
    return (g.T_a_b.t - guess.T_a_b.t).norm() < kSame_m &&
           g.T_a_b.q.angularDistance(guess.T_a_b.q) < 0.3;
  });
  if (same != out.end()) {
    if (same->score >= guess.score) return;
    out.erase(same);
  } else if (full(out)) {
    out.pop_back();
  }
  out.insert(
      std::upper_bound(out.begin(), out.end(), guess,
                       [](const PlaceGuess& g, const PlaceGuess& h) { return g.score > h.score; }),
      guess);
}

}  // namespace maplet
