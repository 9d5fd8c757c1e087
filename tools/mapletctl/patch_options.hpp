// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "core/base/deadline.hpp"
#include "core/frame/sensor_kind.hpp"
#include "core/patches/patch_config.hpp"
#include "drivers/source.hpp"
#include "tools/mapletctl/command_line.hpp"

namespace maplet::ctl {

/// The extractor's settings on the command line: shared by patches and patches-eval.
class PatchOptions {
 public:
  void add_to(Command command);
  /// Throws Failure for a key or value that makes no sense.
  [[nodiscard]] PatchConfig config() const;
  /// The noise model of sources that do not tell their own.
  [[nodiscard]] SourceOptions source() const;
  /// From now: --budget-us on the monotonic clock, or never.
  [[nodiscard]] Deadline deadline() const;

 private:
  int budget_us_ = 0;
  int max_patches_ = 0;
  std::string noise_{kSensorKindNames[0]};
  std::vector<std::string> set_;
  MonotonicClock clock_;
};

/// Thread CPU time and wall time since construction.
class Timed {
 public:
  Timed();
  [[nodiscard]] double cpu_us() const;
  [[nodiscard]] double wall_us() const;

 private:
  double cpu_us_, wall_us_;
};

}  // namespace maplet::ctl
