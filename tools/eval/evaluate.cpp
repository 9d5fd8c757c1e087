// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/eval/evaluate.hpp"

#include <fmt/core.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <numbers>
#include <stdexcept>

namespace maplet::eval {
namespace {

/// The index of the pose whose stamp is nearest to `wanted`; `stamp_of` reads one, ordered.
template <class Items, class StampOf>
[[nodiscard]] std::size_t nearest(const Items& items, Stamp wanted, StampOf stamp_of) {
  const auto after = std::ranges::lower_bound(items, wanted, {}, stamp_of);
  if (after == items.begin()) return 0;
  const auto index = static_cast<std::size_t>(after - items.begin());
  if (after == items.end()) return index - 1;
  return wanted - stamp_of(items[index - 1]) <= stamp_of(*after) - wanted ? index - 1 : index;
}

[[nodiscard]] Duration distance(Stamp a, Stamp b) noexcept { return a < b ? b - a : a - b; }

/// Sums errors of relative motions (eq. 2, 3).
class RelativeSum {
 public:
  void add(const Pair& i, const Pair& j) {
    const Se3 truth = i.truth.inverse() * j.truth;
    const Se3 estimate = i.estimate.inverse() * j.estimate;
    const Se3 error = truth.inverse() * estimate;
    square_m2_ += error.t.squaredNorm();
    square_rad2_ += error.angle() * error.angle();
    ++count_;
  }
  [[nodiscard]] RelativeError rms() const {
    if (count_ == 0) return {};
    const auto n = static_cast<double>(count_);
    return {std::sqrt(square_m2_ / n), std::sqrt(square_rad2_ / n) * 180.0 / std::numbers::pi,
            count_};
  }

 private:
  double square_m2_ = 0.0;
  double square_rad2_ = 0.0;
  std::size_t count_ = 0;
};

[[nodiscard]] RelativeError error_per_frame(const std::vector<Pair>& pairs) {
  RelativeSum sum;
  for (std::size_t i = 1; i < pairs.size(); ++i) sum.add(pairs[i - 1], pairs[i]);
  return sum.rms();
}

/// A partner a second later may be off by half a frame, not more: a gap is no second.
[[nodiscard]] RelativeError error_over(const std::vector<Pair>& pairs, Duration span) {
  std::vector<Duration> spacing;
  for (std::size_t i = 1; i < pairs.size(); ++i) {
    spacing.push_back(pairs[i].stamp - pairs[i - 1].stamp);
  }
  const auto middle = spacing.begin() + static_cast<std::ptrdiff_t>(spacing.size() / 2);
  std::ranges::nth_element(spacing, middle);
  const Duration tolerance = std::max(kAssociationTolerance, *middle / 2);

  RelativeSum sum;
  for (const Pair& i : pairs) {
    const Stamp wanted = i.stamp + span;
    const Pair& j = pairs[nearest(pairs, wanted, [](const Pair& p) { return p.stamp; })];
    if (j.stamp > i.stamp && distance(j.stamp, wanted) <= tolerance) sum.add(i, j);
  }
  return sum.rms();
}

/// Eq. 1.
[[nodiscard]] Se3 align(const std::vector<Pair>& pairs) {
  Eigen::Matrix3Xd from{3, pairs.size()};
  Eigen::Matrix3Xd to{3, pairs.size()};
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    from.col(static_cast<Eigen::Index>(i)) = pairs[i].estimate.t;
    to.col(static_cast<Eigen::Index>(i)) = pairs[i].truth.t;
  }
  const Eigen::Matrix4d T = Eigen::umeyama(from, to, false);
  return {Eigen::Quaterniond{T.topLeftCorner<3, 3>()}, T.topRightCorner<3, 1>()};
}

}  // namespace

std::vector<Pair> associate(const Trajectory& truth, const Trajectory& estimate,
                            Duration tolerance) {
  if (truth.empty()) return {};
  const auto stamp_of = [](const StampedPose& p) { return p.stamp; };
  constexpr std::size_t kNobody = SIZE_MAX;
  std::vector<std::size_t> taken_by(truth.size(), kNobody);
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    const Stamp stamp = estimate[i].stamp;
    const std::size_t k = nearest(truth, stamp, stamp_of);
    const Duration off = distance(truth[k].stamp, stamp);
    if (off > tolerance) continue;
    std::size_t& holder = taken_by[k];
    if (holder == kNobody || off < distance(truth[k].stamp, estimate[holder].stamp)) holder = i;
  }
  std::vector<Pair> pairs;
  for (std::size_t k = 0; k < truth.size(); ++k) {
    if (taken_by[k] == kNobody) continue;
    const StampedPose& mine = estimate[taken_by[k]];
    pairs.push_back({mine.stamp, truth[k].pose, mine.pose});
  }
  return pairs;
}

Evaluation evaluate(const std::vector<Pair>& pairs) {
  if (pairs.size() < 3) {
    throw std::runtime_error{fmt::format(
        "only {} poses of truth and estimate are within {} ms of each other, 3 are needed: check "
        "that both files are of the same recording",
        pairs.size(),
        std::chrono::duration_cast<std::chrono::milliseconds>(kAssociationTolerance).count())};
  }
  Evaluation out;
  out.pairs = pairs.size();
  out.T_truth_estimate = align(pairs);
  double square_m2 = 0.0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const double off_m = (out.T_truth_estimate * pairs[i].estimate.t - pairs[i].truth.t).norm();
    square_m2 += off_m * off_m;
    out.ate_max_m = std::max(out.ate_max_m, off_m);
    if (i > 0) out.path_m += (pairs[i].truth.t - pairs[i - 1].truth.t).norm();
  }
  out.ate_rms_m = std::sqrt(square_m2 / static_cast<double>(pairs.size()));
  out.rpe_frame = error_per_frame(pairs);
  out.rpe_1s = error_over(pairs, std::chrono::seconds{1});
  return out;
}

}  // namespace maplet::eval
