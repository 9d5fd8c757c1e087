// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>

#include "daemon/stage_stats.hpp"

namespace maplet::daemon {

/// A histogram in status and report: the last bound is null, which is none.
[[nodiscard]] inline nlohmann::ordered_json histogram_json(const ToldHistogram& told) {
  nlohmann::ordered_json upper = ToldHistogram::kUpperUs;
  upper.push_back(nullptr);
  return {{"upper_us", upper},
          {"counts", told.counts},
          {"sum_us", static_cast<double>(told.total.count()) / 1e3}};
}

}  // namespace maplet::daemon
