// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/stage_stats.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>

namespace maplet::daemon {

namespace {

constexpr double kSmallestNs = 100.0;
constexpr double kLogStep = 0.00995033085316808;  // log(1.01)

Duration now(clockid_t clock) noexcept {
  timespec time{};
  clock_gettime(clock, &time);
  return std::chrono::seconds{time.tv_sec} + Duration{time.tv_nsec};
}

}  // namespace

void DurationHistogram::add(Duration duration) noexcept {
  const double ns = std::max(kSmallestNs, static_cast<double>(duration.count()));
  const auto bucket = static_cast<std::size_t>(std::log(ns / kSmallestNs) / kLogStep);
  ++buckets_[std::min(bucket, kBuckets - 1)];
  ++count_;
  max_ = std::max(max_, duration);
  total_ += std::max(duration, Duration{0});
}

ToldHistogram DurationHistogram::told() const noexcept {
  ToldHistogram told;
  told.total = total_;
  std::size_t i = 0;
  for (std::size_t bound = 0; bound < ToldHistogram::kUpperUs.size(); ++bound) {
    const double buckets = std::log(1e3 * ToldHistogram::kUpperUs[bound] / kSmallestNs) / kLogStep;
    for (const auto end = static_cast<std::size_t>(std::lround(buckets)); i < end; ++i) {
      told.counts[bound] += buckets_[i];
    }
  }
  for (; i < kBuckets; ++i) told.counts.back() += buckets_[i];
  return told;
}

Duration DurationHistogram::percentile(double share) const noexcept {
  if (count_ == 0) return {};
  const auto wanted = static_cast<std::uint64_t>(std::ceil(share * static_cast<double>(count_)));
  std::uint64_t seen = 0;
  for (std::size_t i = 0; i < kBuckets; ++i) {
    seen += buckets_[i];
    if (seen >= std::max<std::uint64_t>(wanted, 1)) {
      const double upper_ns = kSmallestNs * std::exp(kLogStep * static_cast<double>(i + 1));
      return std::min(max_, Duration{std::llround(upper_ns)});
    }
  }
  return max_;
}

void StageMeters::begin(Stage stage) noexcept {
  starts_[static_cast<std::size_t>(stage)] = {now(CLOCK_MONOTONIC), now(CLOCK_THREAD_CPUTIME_ID)};
}

void StageMeters::end(Stage stage, Duration budget) noexcept {
  const auto i = static_cast<std::size_t>(stage);
  const Duration cpu = now(CLOCK_THREAD_CPUTIME_ID) - starts_[i].cpu;
  const Duration wall = now(CLOCK_MONOTONIC) - starts_[i].wall;
  add(stage, wall, cpu, budget);
}

void StageMeters::add(Stage stage, Duration wall, Duration cpu, Duration budget) noexcept {
  StageStats& stats = stats_[static_cast<std::size_t>(stage)];
  stats.wall.add(wall);
  stats.cpu.add(cpu);
  if (wall > budget) ++stats.deadline_misses;
}

StageTime StageMeters::summary(Stage stage) const noexcept {
  const auto us = [](Duration duration) {
    return static_cast<std::uint32_t>(duration / std::chrono::microseconds{1});
  };
  const StageStats& stats = of(stage);
  return {us(stats.cpu.percentile(0.5)), us(stats.cpu.percentile(0.99)), us(stats.cpu.max()),
          static_cast<std::uint32_t>(stats.deadline_misses)};
}

}  // namespace maplet::daemon
