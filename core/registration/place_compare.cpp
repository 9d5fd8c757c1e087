// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/registration/place_compare.hpp"

#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

namespace maplet {

namespace {

constexpr float kSameAngle = 0.1F;      // between two axes' cosines in a and in b
constexpr float kAlongCosine = 0.98F;   // an axis of b on one of a
constexpr float kUpCosine = 0.95F;      // where gravity is known on both sides
constexpr float kSameTurnTrace = 2.9F;  // of R1^T R2: less than 18 deg
constexpr std::size_t kTurnsTried = 8;
constexpr float kTurnsShare = 0.7F;    // of the best turn's votes
constexpr float kShiftsShare = 0.75F;  // of the best shifts' votes

Eigen::Matrix3f frame(const Eigen::Vector3f& x, const Eigen::Vector3f& y) noexcept {
  Eigen::Matrix3f f;
  f.col(0) = x;
  f.col(2) = x.cross(y).normalized();
  f.col(1) = f.col(2).cross(x);
  return f;
}

}  // namespace

void PlaceCompare::count_votes(const PlaceAxis& a, const PlaceAxis& b, bool flipped,
                               const Window& window, Votes& out) noexcept {
  const int count = std::min(kBins, static_cast<int>(2.0F * window.reach_m / kBin_m));
  const float zero = 0.5F * static_cast<float>(count) - window.middle_m / kBin_m;
  std::fill_n(bins_.begin(), count + 2, 0.0F);
  for (const PlaceAxis::Mark& mb : b.marks) {
    const float at_b = (flipped ? mb.at_m() : -mb.at_m()) / kBin_m + zero;
    const bool ahead = mb.ahead() != flipped;
    for (const PlaceAxis::Mark& ma : a.marks) {
      const float at = ma.at_m() / kBin_m + at_b;
      if (ma.ahead() != ahead || !(at > 0.0F && at < static_cast<float>(count))) continue;
      const auto bin = static_cast<int>(at);
      const float part = at - static_cast<float>(bin);
      const float vote = std::min(ma.weight(), mb.weight());
      bins_[static_cast<std::size_t>(bin)] += (1.0F - part) * vote;
      bins_[static_cast<std::size_t>(bin) + 1] += part * vote;
    }
  }
  out.best = *std::max_element(bins_.begin(), bins_.begin() + count + 2);
  out.peaks.clear();
  if (!window.want_peaks || out.best <= 0.0F) return;
  for (int i = 0; i <= count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const float here = bins_[k];
    const float before = i > 0 ? bins_[k - 1] : 0.0F;
    const float next = bins_[k + 1];
    if (here < 0.3F * out.best || here < before || here <= next) continue;
    const float off = (next - before) / (before + here + next);
    const Peak peak{(static_cast<float>(i) + off - zero) * kBin_m, here};
    if (full(out.peaks)) {
      if (out.peaks.back().votes >= here) continue;
      out.peaks.pop_back();
    }
    out.peaks.insert(
        std::upper_bound(out.peaks.begin(), out.peaks.end(), peak,
                         [](const Peak& x, const Peak& y) { return x.votes > y.votes; }),
        peak);
  }
}

const PlaceCompare::Votes& PlaceCompare::votes(std::size_t ia, std::size_t ib, bool flipped,
                                               bool want_peaks) noexcept {
  Votes& v = votes_[(ia * kAxes + ib) * 2 + (flipped ? 1 : 0)];
  if (v.best < 0.0F) {
    Window all;
    all.want_peaks = want_peaks;
    count_votes(a_->axes[ia], b_->axes[ib], flipped, all, v);
  }
  return v;
}

void PlaceCompare::add_turn(const Eigen::Matrix3f& R, bool want_peaks) noexcept {
  if (!a_->up.isZero() && !b_->up.isZero() && a_->up.dot(R * b_->up) < kUpCosine) return;
  if (full(turns_)) return;
  for (const Turn& known : turns_) {  // other pairs of axes find it again
    if (known.R.cwiseProduct(R).sum() >= kSameTurnTrace) return;
  }
  Turn turn;
  turn.R = R;
  turn.score = 0.0F;
  for (std::size_t ib = 0; ib < b_->axes.size(); ++ib) {
    const Eigen::Vector3f direction = R * b_->axes[ib].direction;
    for (std::size_t ia = 0; ia < a_->axes.size(); ++ia) {
      const float cosine = a_->axes[ia].direction.dot(direction);
      if (std::abs(cosine) < kAlongCosine || turn.of_a[ia].axis_b >= 0) continue;
      turn.of_a[ia].axis_b = static_cast<std::int8_t>(ib);
      turn.of_a[ia].flipped = cosine < 0.0F;
      turn.score += votes(ia, ib, cosine < 0.0F, want_peaks).best;
      break;
    }
  }
  turns_.push_back(turn);
}

// Two axes of a on two of b fix a turn.
void PlaceCompare::find_turns(const PlaceDescriptor& a, const PlaceDescriptor& b, bool want_peaks,
                              Deadline deadline) noexcept {
  a_ = &a;
  b_ = &b;
  turns_.clear();
  for (Votes& v : votes_) v.best = -1.0F;
  constexpr std::size_t kPairs[][2] = {{0, 1}, {0, 2}, {1, 2}};
  for (const auto& [i1, i2] : kPairs) {
    if (i2 >= a.axes.size()) break;
    const Eigen::Vector3f& a1 = a.axes[i1].direction;
    const Eigen::Vector3f& a2 = a.axes[i2].direction;
    const float between = a1.dot(a2);
    if (std::abs(between) > 0.9F) continue;
    const Eigen::Matrix3f frame_a = frame(a1, a2);
    for (std::size_t k1 = 0; k1 < b.axes.size(); ++k1) {
      for (std::size_t k2 = 0; k2 < b.axes.size(); ++k2) {
        if (k1 == k2 || deadline.expired()) continue;
        const float between_b = b.axes[k1].direction.dot(b.axes[k2].direction);
        for (const float s1 : {1.0F, -1.0F}) {
          for (const float s2 : {1.0F, -1.0F}) {
            if (std::abs(s1 * s2 * between_b - between) > kSameAngle) continue;
            const Eigen::Matrix3f frame_b =
                frame(s1 * b.axes[k1].direction, s2 * b.axes[k2].direction);
            add_turn(frame_a * frame_b.transpose(), want_peaks);
          }
        }
      }
    }
  }
  std::sort(turns_.begin(), turns_.end(),
            [](const Turn& x, const Turn& y) { return x.score > y.score; });
}

float PlaceCompare::rank(const PlaceDescriptor& a, const PlaceDescriptor& b) noexcept {
  find_turns(a, b, false, Deadline::never());
  return turns_.empty() ? 0.0F
                        : turns_.front().score / std::max(1e-6F, std::min(a.weight, b.weight));
}

void PlaceCompare::try_shifts(const Turn& turn, Guesses& out) noexcept {
  // The three axes of a that the turn finds again, best votes first, and that span space.
  StaticVector<std::size_t, 3> used;
  for (std::size_t ia = 0; ia < a_->axes.size() && used.size() < 3; ++ia) {
    if (turn.of_a[ia].axis_b >= 0) used.push_back(ia);
  }
  if (used.size() < 3) return;
  Eigen::Matrix3f rows;
  const StaticVector<Peak, kPeaks>* peaks[3];
  for (std::size_t i = 0; i < 3; ++i) {
    const auto& on = turn.of_a[used[i]];
    rows.row(static_cast<Eigen::Index>(i)) = a_->axes[used[i]].direction.transpose();
    peaks[i] = &votes(used[i], static_cast<std::size_t>(on.axis_b), on.flipped, true).peaks;
  }
  if (std::abs(rows.determinant()) < 0.3F) return;
  for (const auto* list : peaks) {
    if (list->empty()) return;
  }
  const Eigen::Matrix3f solve = rows.inverse();
  turn_planes(turn.R);
  const float least =
      kShiftsShare * (peaks[0]->front().votes + peaks[1]->front().votes + peaks[2]->front().votes);
  for (const Peak& x : *peaks[0]) {
    for (const Peak& y : *peaks[1]) {
      for (const Peak& z : *peaks[2]) {
        if (x.votes + y.votes + z.votes < least) break;
        keep(turn.R, solve * Eigen::Vector3f{x.shift_m, y.shift_m, z.shift_m}, out);
      }
    }
  }
  try_middles(turn.R, rows, peaks, out);
}

PlaceCompare::Guesses PlaceCompare::guess(const PlaceDescriptor& a,
                                          const PlaceDescriptor& b) noexcept {
  Guesses out;
  find_turns(a, b, true, Deadline::never());
  for (std::size_t i = 0; i < std::min(turns_.size(), kTurnsTried); ++i) {
    if (turns_[i].score < kTurnsShare * turns_.front().score) break;
    try_shifts(turns_[i], out);
  }
  return out;
}

}  // namespace maplet
