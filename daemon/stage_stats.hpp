// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

#include "core/ports/stage_meter.hpp"
#include "transport/exchange/status_record.hpp"

namespace maplet::daemon {

/// A histogram as it is told: how many took at most so long, and longer than the bound before; the
/// last ones longer than all.
struct ToldHistogram {
  static constexpr std::array kUpperUs{50,   100,   200,   500,   1000,  2000,
                                       5000, 10000, 20000, 50000, 100000};
  std::array<std::uint64_t, kUpperUs.size() + 1> counts{};
  Duration total{};
};

/// A histogram of durations in fixed memory: buckets 1 % apart from 100 ns to 17 minutes.
class DurationHistogram {
 public:
  void add(Duration duration) noexcept;
  /// The duration that `share` (0..1) of all stay at or under, to 1 %; 0 when there are none.
  [[nodiscard]] Duration percentile(double share) const noexcept;
  [[nodiscard]] Duration max() const noexcept { return max_; }
  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
  /// In few words; its bounds are right to 1 %.
  [[nodiscard]] ToldHistogram told() const noexcept;

 private:
  static constexpr std::size_t kBuckets = 2320;
  std::array<std::uint64_t, kBuckets> buckets_{};
  std::uint64_t count_ = 0;
  Duration max_{};
  Duration total_{};
};

/// What one stage cost so far.
struct StageStats {
  DurationHistogram wall;  ///< monotonic clock
  DurationHistogram cpu;   ///< this thread's CPU clock
  std::uint64_t deadline_misses = 0;
};

/// Measures every stage of one thread on the machine's clocks, whatever clock the stages see.
///
/// Memory   fixed, about 300 KB. Threads  one.
class StageMeters final : public StageMeter {
 public:
  void begin(Stage stage) noexcept override;
  void end(Stage stage, Duration budget) noexcept override;
  /// What was measured elsewhere.
  void add(Stage stage, Duration wall, Duration cpu, Duration budget) noexcept;
  [[nodiscard]] const StageStats& of(Stage stage) const noexcept {
    return stats_[static_cast<std::size_t>(stage)];
  }

  /// For status records: CPU times.
  [[nodiscard]] StageTime summary(Stage stage) const noexcept;

 private:
  struct Start {
    Duration wall{};
    Duration cpu{};
  };
  std::array<StageStats, kStages> stats_{};
  std::array<Start, kStages> starts_{};
};

}  // namespace maplet::daemon
