// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>

#include "core/agent/agent.hpp"
#include "core/ports/depth_source.hpp"
#include "daemon/radio_link.hpp"
#include "daemon/run_totals.hpp"
#include "daemon/stage_stats.hpp"

namespace maplet::daemon {

/// report.json (docs/output.md). `radio`: nullptr without DDS. Allocates: only after the run.
[[nodiscard]] std::string report_json(const RunTotals& totals, const SourceCounters& source,
                                      const StageMeters& meters, std::size_t arena_bytes,
                                      const RadioStatus* radio, const Agent& agent);

}  // namespace maplet::daemon
