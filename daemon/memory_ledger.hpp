// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "core/base/arena.hpp"
#include "daemon/config.hpp"
#include "daemon/memory_parts.hpp"

namespace maplet::daemon {

/// All memory that the daemon may take with a configuration, decided before it starts.
struct MemoryLedger {
  std::vector<ArenaEntry> arena;  ///< the stages, by component
  std::size_t arena_bytes = 0;    ///< with alignment
  std::vector<ArenaEntry>
      beside;                   ///< bounds of what libraries and our queues take (docs/memory.md)
  std::size_t total_bytes = 0;  ///< both
};

/// Builds the stages once to ask them; touches no camera and no network.
/// Throws ArenaExhausted when the configuration asks for more than any machine of ours has.
[[nodiscard]] MemoryLedger memory_ledger(const Config& config, MemoryParts parts);

/// What --print-memory prints.
[[nodiscard]] std::string to_text(const MemoryLedger& ledger);

/// What MemoryMax has to be: the ledger, and the pages of the program itself.
[[nodiscard]] std::size_t unit_memory_bytes(const MemoryLedger& ledger);

/// What --print-unit-limits prints: a drop-in for the systemd unit.
[[nodiscard]] std::string unit_limits(const MemoryLedger& ledger);

/// Whether a limit of the control group leaves room for the configuration. Stays inside the limit
/// while it looks.
/// @return what is wrong, on one line; then the ledger, or as much of it as fits
[[nodiscard]] std::optional<std::string> refusal(const Config& config, MemoryParts parts,
                                                 std::uint64_t cgroup_limit_bytes);

}  // namespace maplet::daemon
