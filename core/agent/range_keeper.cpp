// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/agent/range_keeper.hpp"

#include <algorithm>
#include <cmath>

namespace maplet {

namespace {

constexpr Duration kBehind = std::chrono::milliseconds{500};  // the newest origin still counts
constexpr double kUneven = 0.25;  // of the way between two origins: nobody moves evenly

void widen(CarriedRange& range, Duration unseen) noexcept {
  range.sigma_m = std::hypot(range.sigma_m, RangeKeeper::kSpeed_m_per_s * seconds(unseen));
}

}  // namespace

std::optional<PathPoint> path_point_of(const Skeleton& skeleton, std::uint16_t agent,
                                       Stamp stamp) noexcept {
  std::optional<PathPoint> found;
  for (int i = 0; i < skeleton.factor_count(); ++i) {
    const Skeleton::FactorView f = skeleton.factor(i);
    if (f.kind != DeltaPose::Kind::kConsecutive || f.a.agent != agent || f.b.agent != agent)
      continue;
    if (stamp < f.stamp_a || stamp > f.stamp_b + kBehind || f.stamp_b <= f.stamp_a) continue;
    const double share = std::min(1.0, seconds(stamp - f.stamp_a) / seconds(f.stamp_b - f.stamp_a));
    const Vector6d way = f.T_a_b.log();
    PathPoint point;
    const bool first = share <= 0.5;
    point.maplet = first ? f.a : f.b;
    point.stamp = stamp;
    point.stamp_maplet = first ? f.stamp_a : f.stamp_b;
    const Vector6d from_origin = first ? Vector6d{share * way} : Vector6d{(share - 1.0) * way};
    point.T_maplet_camera = Transform<MapletFrame, CameraFrame>{Se3::exp(from_origin)};
    const double unsure = 4.0 * share * (1.0 - share) * kUneven;
    const double behind_m =
        RangeKeeper::kSpeed_m_per_s * seconds(std::max(stamp - f.stamp_b, Duration{0}));
    point.covariance.diagonal().head<3>().setConstant(
        std::pow(unsure * way.head<3>().norm() + behind_m, 2));
    point.covariance.diagonal().tail<3>().setConstant(std::pow(unsure * way.tail<3>().norm(), 2));
    // A delta-pose that begins where this one ends is nearer to the moment than the half second
    // behind it; of several lives, the one that was heard of last.
    if (found && stamp > f.stamp_b && found->maplet.epoch == f.a.epoch) continue;
    found = point;
  }
  return found;
}

void RangeKeeper::drop(std::size_t index) noexcept {
  ++counters_.dropped;
  waiting_.erase(waiting_.begin() + static_cast<std::ptrdiff_t>(index));
}

void RangeKeeper::note(const RangeToAgent& range) noexcept {
  ++counters_.measured;
  if (full(waiting_)) drop(0);
  Entry entry;
  entry.range = range;
  waiting_.push_back(entry);
}

void RangeKeeper::at_frame(Stamp frame, const std::optional<PathPoint>& at) noexcept {
  newest_frame_ = frame;
  for (std::size_t i = 0; i < waiting_.size();) {
    Entry& entry = waiting_[i];
    const Duration late = frame - entry.range.stamp;
    if (!entry.here && late > kLate) {
      drop(i);
      continue;
    }
    if (!entry.here && late >= Duration{0} && at) {
      entry.ours = carry_to_origin(*at, entry.range.measured);
      widen(entry.ours, late);
      entry.here = true;
    }
    ++i;
  }
}

std::optional<MapletRange> RangeKeeper::place(const Skeleton& skeleton) noexcept {
  if (waiting_.empty()) return {};
  next_ = (next_ + 1) % waiting_.size();
  const Entry entry = waiting_[next_];
  if (!entry.here) return {};
  const Stamp there = entry.range.stamp + entry.range.clock_offset;
  const auto at = path_point_of(skeleton, entry.range.other, there);
  if (!at) {
    if (newest_frame_ - entry.range.stamp > kPatience) drop(next_);
    return {};
  }
  // The direction is known at our end alone.
  CarriedRange carried = carry_to_origin(*at, {entry.ours.range_m, entry.ours.sigma_m});
  if (at->T_maplet_camera.se3.t.isZero())
    carried.sigma_m = std::hypot(carried.sigma_m, std::sqrt(at->covariance(0, 0)));
  waiting_.erase(waiting_.begin() + static_cast<std::ptrdiff_t>(next_));
  ++counters_.placed;
  return MapletRange{entry.ours.maplet, carried.maplet, entry.range.stamp, carried.range_m,
                     carried.sigma_m};
}

}  // namespace maplet
