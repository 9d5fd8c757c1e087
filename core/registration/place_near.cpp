// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Where the planes of two maplets coincide near a guess: a turn and shifts by votes, as without
// one, within its gates.
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "core/registration/place_compare.hpp"

namespace maplet {

namespace {

constexpr float kNearShare = 0.7F;  // of the best shifts' votes
constexpr float kNearReach = 1.5F;  // of the gate: three axes' shifts together
constexpr float kStep_m = 0.2F;
constexpr float kAxes_rad = 0.05F;  // what axes are off by
constexpr float kNearTurn_rad = 0.12F;
constexpr float kClear = 0.3F;  // score above which the turn was the right one
constexpr std::size_t kTurnsNear = 3;

// Whether a direction is well out of the span of those there are.
template <class Rows>
bool spans_more(const Rows& rows, const Eigen::Vector3f& direction) noexcept {
  if (rows.empty()) return true;
  if (rows.size() == 1) return rows[0].cross(direction).norm() > 0.5F;
  return std::abs(rows[0].cross(rows[1]).normalized().dot(direction)) > 0.5F;
}

}  // namespace

// Brings axes of b within reach onto those of a, as near as they go.
bool PlaceCompare::turn_onto_axes(float reach_rad, Turn& turn) const noexcept {
  for (auto& on : turn.of_a) on.axis_b = -1;
  Eigen::Matrix3f h = Eigen::Matrix3f::Zero();
  float total = 0.0F;
  for (std::size_t ib = 0; ib < b_->axes.size(); ++ib) {
    const Eigen::Vector3f direction = turn.R * b_->axes[ib].direction;
    float most = std::cos(std::min(reach_rad, 0.7F));
    std::size_t best = kAxes;
    for (std::size_t ia = 0; ia < a_->axes.size(); ++ia) {
      const float cosine = std::abs(a_->axes[ia].direction.dot(direction));
      if (cosine <= most || turn.of_a[ia].axis_b >= 0) continue;
      most = cosine;
      best = ia;
    }
    if (best == kAxes) continue;
    const bool flipped = a_->axes[best].direction.dot(direction) < 0.0F;
    turn.of_a[best].axis_b = static_cast<std::int8_t>(ib);
    turn.of_a[best].flipped = flipped;
    const float weight = std::min(a_->axes[best].weight, b_->axes[ib].weight);
    h += (flipped ? -weight : weight) * a_->axes[best].direction *
         b_->axes[ib].direction.transpose();
    total += weight;
  }
  if (total <= 0.0F) return false;
  h += 0.01F * total * turn.R;
  const Eigen::JacobiSVD<Eigen::Matrix3f, Eigen::NoQRPreconditioner> svd{
      h, Eigen::ComputeFullU | Eigen::ComputeFullV};
  Eigen::Matrix3f fix = Eigen::Matrix3f::Identity();
  fix(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant();
  turn.R = svd.matrixU() * fix * svd.matrixV().transpose();
  return true;
}

// Shifts within reach_m of t: those that the axes vote for, and all along the axis that says least.
void PlaceCompare::try_near(const Turn& turn, const Eigen::Vector3f& t, float reach_m,
                            Deadline deadline, Guesses& out) noexcept {
  Window window;
  window.want_peaks = true;
  window.reach_m = reach_m;
  // Three directions that span space: axes that both have, then whatever is left, as guessed.
  StaticVector<Eigen::Vector3f, 3> rows;
  StaticVector<StaticVector<Peak, kPeaks>, 3> shifts;
  for (std::size_t ia = 0; ia < a_->axes.size() && rows.size() < 3; ++ia) {
    const auto& on = turn.of_a[ia];
    const Eigen::Vector3f& direction = a_->axes[ia].direction;
    if (on.axis_b < 0 || !spans_more(rows, direction)) continue;
    if (deadline.expired()) return;
    Votes v;
    window.middle_m = direction.dot(t);
    count_votes(a_->axes[ia], b_->axes[static_cast<std::size_t>(on.axis_b)], on.flipped, window, v);
    if (v.peaks.empty()) v.peaks.push_back({window.middle_m, 0.0F});
    rows.push_back(direction);
    shifts.push_back(v.peaks);
  }
  for (int i = 0; i < 3 && rows.size() < 3; ++i) {
    if (!spans_more(rows, Eigen::Vector3f::Unit(i))) continue;
    rows.push_back(Eigen::Vector3f::Unit(i));
    shifts.push_back({Peak{t[i], 0.0F}});
  }
  if (rows.size() < 3) return;
  std::size_t weak = 0;
  for (std::size_t i = 1; i < 3; ++i) {
    if (shifts[i].front().votes < shifts[weak].front().votes) weak = i;
  }
  const std::size_t one = (weak + 1) % 3;
  const std::size_t two = (weak + 2) % 3;
  Eigen::Matrix3f all;
  all << rows[one].transpose(), rows[two].transpose(), rows[weak].transpose();
  const Eigen::Matrix3f solve = all.inverse();
  turn_planes(turn.R);
  const float least = kNearShare * (shifts[one].front().votes + shifts[two].front().votes);
  for (const Peak& x : shifts[one]) {
    for (const Peak& y : shifts[two]) {
      if (x.votes + y.votes < least) break;
      const auto keep_at = [&](float shift_m) {
        const Eigen::Vector3f at = solve * Eigen::Vector3f{x.shift_m, y.shift_m, shift_m};
        if ((at - t).norm() <= kNearReach * reach_m) keep(turn.R, at, out);
      };
      for (const Peak& z : shifts[weak]) keep_at(z.shift_m);
      for (float s = -reach_m; s <= reach_m; s += kStep_m) {
        if (deadline.expired()) return;
        keep_at(rows[weak].dot(t) + s);
      }
    }
  }
}

PlaceCompare::Guesses PlaceCompare::guess_near(const PlaceDescriptor& a, const PlaceDescriptor& b,
                                               const Se3& T_a_b, double gate_m, double gate_rad,
                                               Deadline deadline) noexcept {
  a_ = &a;
  b_ = &b;
  Guesses out;
  const Eigen::Vector3f t = T_a_b.t.cast<float>();
  const auto reach_m = static_cast<float>(gate_m);
  const float reach_rad = static_cast<float>(gate_rad) + kAxes_rad;
  Turn turn;
  turn.R = T_a_b.rotation().cast<float>();
  const Eigen::Matrix3f R_guess = turn.R;
  if (turn_onto_axes(reach_rad, turn) && turn_onto_axes(kNearTurn_rad, turn)) {
    try_near(turn, t, reach_m, deadline, out);
  }
  if ((!out.empty() && out.front().score >= kClear) || deadline.expired()) return out;
  // The nearest axes were others: all turns within the gate.
  find_turns(a, b, false, deadline);
  std::size_t tried = 0;
  for (const Turn& other : turns_) {
    if (tried == kTurnsNear || deadline.expired()) break;
    const float cosine = 0.5F * (R_guess.cwiseProduct(other.R).sum() - 1.0F);
    if (cosine < std::cos(std::min(reach_rad, 1.5F))) continue;
    turn.R = other.R;
    if (!turn_onto_axes(kNearTurn_rad, turn)) continue;
    ++tried;
    try_near(turn, t, reach_m, deadline, out);
  }
  return out;
}

}  // namespace maplet
