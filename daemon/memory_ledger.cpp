// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/memory_ledger.hpp"

#include <fmt/format.h>

#include "core/agent/agent.hpp"
#include "daemon/own_records.hpp"
#include "daemon/radio_link.hpp"
#include "daemon/stage_stats.hpp"

namespace maplet::daemon {

std::string memory_ledger(const Config& config) {
  Arena arena;
  const auto meters = std::make_unique<StageMeters>();
  OwnRecords records{{}};
  const auto agent =
      arena.make<Agent>("agent", config.agent, AgentIdentity{}, *meters, records, arena);
  const RadioLink radio{config, {}, arena};
  std::string text = fmt::format("{:<40} {:>10} {:>14}\n", "component", "count", "bytes");
  for (const ArenaEntry& entry : arena.ledger()) {
    text += fmt::format("{:<40} {:>10} {:>14}\n", entry.component, entry.count, entry.bytes);
  }
  text += fmt::format("{:<40} {:>10} {:>14}\n", "total (with alignment)", "", arena.used_bytes());
  return text;
}

}  // namespace maplet::daemon
