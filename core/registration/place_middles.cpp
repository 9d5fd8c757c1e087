// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Shifts along an axis that few planes are perpendicular to: planes that coincide otherwise vote
// with their middles.
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/registration/place_compare.hpp"

namespace maplet {

namespace {

constexpr float kFewVotes = 1.0F;     // two small planes, or less than a wall
constexpr float kPairsShare = 0.75F;  // of the best shifts' votes on the other two axes
constexpr float kAcross = 0.25F;      // cosine between a plane's normal and an axis it is along
constexpr float kPlaneGate_m = 0.12F;
constexpr float kAlike_m = 0.15F;  // what extents of one surface differ by
constexpr std::size_t kMiddles = 3;

// How far a rectangle reaches along an axis.
float reach(const Eigen::Vector3f& axis, const Eigen::Vector3f& u, const Eigen::Vector3f& v,
            const PlacePlane& p) noexcept {
  return std::abs(axis.dot(u)) * p.half_u_m + std::abs(axis.dot(v)) * p.half_v_m;
}

}  // namespace

void PlaceCompare::try_middles(const Eigen::Matrix3f& R, const Eigen::Matrix3f& rows,
                               const StaticVector<Peak, kPeaks>* const peaks[3],
                               Guesses& out) noexcept {
  int weak = 0;
  for (int i = 1; i < 3; ++i) {
    if (peaks[i]->front().votes < peaks[weak]->front().votes) weak = i;
  }
  if (peaks[weak]->front().votes >= kFewVotes) return;
  const int one = (weak + 1) % 3;
  const int two = (weak + 2) % 3;
  const Eigen::Matrix3f solve = rows.inverse();
  const float least = kPairsShare * (peaks[one]->front().votes + peaks[two]->front().votes);
  for (const Peak& x : *peaks[one]) {
    for (const Peak& y : *peaks[two]) {
      if (x.votes + y.votes < least) break;
      const Eigen::Vector3f t = x.shift_m * solve.col(one) + y.shift_m * solve.col(two);
      for (const Peak& s : middles(rows.row(weak).transpose(), solve.col(weak), t)) {
        keep(R, t + s.shift_m * solve.col(weak), out);
      }
    }
  }
}

// eq. 16b
StaticVector<PlaceCompare::Peak, PlaceCompare::kPeaks> PlaceCompare::middles(
    const Eigen::Vector3f& axis, const Eigen::Vector3f& shift, const Eigen::Vector3f& t) noexcept {
  bins_.fill(0.0F);
  for (std::size_t ib = 0; ib < turned_.size(); ++ib) {
    const PlacePlane& pb = b_->planes[ib];
    const Turned& turned = turned_[ib];
    if (std::abs(turned.n.dot(shift)) > kAcross) continue;
    const float reach_b = reach(axis, turned.u, turned.v, pb);
    for (const Turned::Along& along : turned.along) {
      const PlacePlane& pa = a_->planes[along.of_a];
      if (std::abs(along.off_m + pa.n.dot(t)) > kPlaneGate_m) continue;
      const float apart = std::abs(reach(axis, pa.u, pa.n.cross(pa.u), pa) - reach_b);
      const float vote = std::min(pa.weight, pb.weight) / (1.0F + apart / kAlike_m);
      const float at = axis.dot(pa.centre - turned.centre - t) / kBin_m + 0.5F * kBins;
      if (!(at > 1.0F && at < static_cast<float>(kBins))) continue;
      const auto bin = static_cast<std::size_t>(at);
      const float part = at - static_cast<float>(bin);
      bins_[bin - 1] += 0.5F * (1.0F - part) * vote;
      bins_[bin] += (1.0F - 0.5F * part) * vote;
      bins_[bin + 1] += 0.5F * (1.0F + part) * vote;
      bins_[bin + 2] += 0.5F * part * vote;
    }
  }
  StaticVector<Peak, kPeaks> out;
  for (std::size_t k = 1; k + 1 < bins_.size(); ++k) {
    const float here = bins_[k];
    if (here <= 0.0F || here < bins_[k - 1] || here <= bins_[k + 1]) continue;
    const Peak peak{(static_cast<float>(k) - 0.5F * kBins) * kBin_m, here};
    if (out.size() == kMiddles) {
      if (out.back().votes >= here) continue;
      out.pop_back();
    }
    out.insert(std::upper_bound(out.begin(), out.end(), peak,
                                [](const Peak& p, const Peak& q) { return p.votes > q.votes; }),
               peak);
  }
  return out;
}

}  // namespace maplet
