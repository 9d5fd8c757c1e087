// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/memory_ledger.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <numeric>

#include "core/agent/agent.hpp"
#include "core/base/arena_exhausted.hpp"
#include "daemon/app.hpp"
#include "daemon/capture_thread.hpp"
#include "daemon/console.hpp"
#include "daemon/neighbours.hpp"
#include "daemon/own_records.hpp"
#include "daemon/radio_link.hpp"
#include "daemon/stage_stats.hpp"
#include "drivers/gray_ring.hpp"

namespace maplet::daemon {

namespace {

constexpr std::size_t kMiB = std::size_t{1} << 20;
constexpr std::size_t kKiB = std::size_t{1} << 10;

// Measured, and rounded up: docs/memory.md.
constexpr std::size_t kParticipantBytes = 1280 * kKiB;  // one Cyclone participant, idle
constexpr std::size_t kKeptDeltaPoseBytes = 4400;       // a sample in a writer's history
constexpr std::size_t kQueueBytes = 768 * kKiB;         // the publisher's
constexpr std::size_t kStackBytes = 128 * kKiB;         // what a thread touches of its stack
constexpr std::size_t kRosHistoryBytes =
    10 * 128 * kKiB;                    // markers and path, kept for late readers
constexpr std::size_t kOwnThreads = 6;  // the journal's beside
constexpr std::size_t kDdsThreads = 10;
constexpr std::size_t kRuntimeBytes = 2 * kMiB;  // allocator, log, configuration
constexpr std::size_t kCameraFrames = 8;         // the runtime's and the driver's
constexpr std::uint64_t kMostArenaBytes = std::uint64_t{1} << 32;
constexpr std::size_t kProgramBytes = 16 * kMiB;  // pages of the program and its libraries

void add(MemoryLedger& ledger, std::string_view component, std::size_t count, std::size_t bytes) {
  ledger.beside.push_back({component, count, count * bytes});
}

void add_beside(MemoryLedger& ledger, const Config& config, MemoryParts parts) {
  add(ledger, "stage meters", 1, sizeof(StageMeters));
  add(ledger, "control answers", 1,
      Console::bytes(static_cast<std::size_t>(config.agent.skeleton.max_nodes)));
  const bool ros = parts.dds && config.ros2.enabled;
  const std::size_t more = (config.gpio.used() ? 1 : 0) + (config.gray.used() ? 1 : 0) +
                           (parts.journal ? 1 : 0) + (ros ? 1 : 0);
  add(ledger, "threads/ours, stacks", kOwnThreads + more, kStackBytes);
  add(ledger, "runtime", 1, kRuntimeBytes);
  if (Neighbours::needed(config, parts.dds))
    add(ledger, "neighbours/queues, map, path", 1, neighbours_bytes(config, parts.dds));
  if (ros) add(ledger, "ros2/history of the writers", 1, kRosHistoryBytes);
  if (!config.recorder.file.empty()) {
    const auto queue = static_cast<std::size_t>(config.recorder.queue_kib) * kKiB;
    add(ledger, "recorder/queue and two items", 3, queue);
  }
  if (parts.journal) {
    add(ledger, "journal/queue", 1, JournalWriter::bytes_beside(config.journal.queue_bytes()));
  }
  if (parts.dds) {
    add(ledger, "radio/queues", 1, sizeof(RadioLink) + RadioLink::queue_bytes());
    add(ledger, "dds/participants", 2, kParticipantBytes);
    add(ledger, "dds/threads, stacks", kDdsThreads, kStackBytes);
    add(ledger, "dds/publisher queues", 1, kQueueBytes);
    add(ledger, "dds/delta-pose history", static_cast<std::size_t>(config.dds.delta_pose_history),
        kKeptDeltaPoseBytes);
    add(ledger, "dds/maplet history", static_cast<std::size_t>(config.dds.maplet_history),
        static_cast<std::size_t>(config.agent.maplet.max_bytes));
  }
  const std::size_t pixels = config.agent.limits.image().pixels();
  add(ledger, "capture/frames", 1, FramePool::bytes(pixels));
  if (config.gray.used()) {
    add(ledger, "gray camera/images", GrayRing::kImages + 2 + kCameraFrames,
        static_cast<std::size_t>(config.gray.width_px) *
            static_cast<std::size_t>(config.gray.height_px));
  }
  if (config.input.source.empty() || config.input.source.starts_with("openni2:")) {
    add(ledger, "openni2/frames", kCameraFrames, pixels * 2);
    if (config.input.gray == "auto")
      add(ledger, "openni2/colour frames", kCameraFrames, pixels * 3);
  }
}

}  // namespace

namespace {

/// The stages in `arena`, asked; throws when it is too small.
void add_stages(Arena& arena, const Config& config, MemoryParts parts) {
  const auto meters = std::make_unique<StageMeters>();
  OwnRecords records{{}};
  const auto agent =
      arena.make<Agent>("agent", config.agent, AgentIdentity{}, *meters, records, arena);
  const auto radio =
      parts.dds ? std::make_unique<RadioLink>(config, AgentIdentity{}, arena) : nullptr;
  journal::PosixFile no_file;
  const auto journal = parts.journal
                           ? std::make_unique<JournalWriter>(no_file, journal::Survey{}, Life{},
                                                             journal_config(config), arena)
                           : nullptr;
}

MemoryLedger ledger_of(const Arena& arena, const Config& config, MemoryParts parts) {
  MemoryLedger ledger;
  ledger.arena.assign(arena.ledger().begin(), arena.ledger().end());
  ledger.arena_bytes = arena.used_bytes();
  add_beside(ledger, config, parts);
  ledger.total_bytes =
      std::accumulate(ledger.beside.begin(), ledger.beside.end(), ledger.arena_bytes,
                      [](std::size_t sum, const ArenaEntry& entry) { return sum + entry.bytes; });
  return ledger;
}

}  // namespace

MemoryLedger memory_ledger(const Config& config, MemoryParts parts) {
  Arena arena{kMostArenaBytes};
  add_stages(arena, config, parts);
  return ledger_of(arena, config, parts);
}

std::string to_text(const MemoryLedger& ledger) {
  constexpr const char* kLine = "{:<40} {:>10} {:>14}\n";
  std::string text = fmt::format(kLine, "component", "count", "bytes");
  for (const ArenaEntry& entry : ledger.arena) {
    text += fmt::format(kLine, entry.component, entry.count, entry.bytes);
  }
  text += fmt::format(kLine, "arena (with alignment)", "", ledger.arena_bytes);
  for (const ArenaEntry& entry : ledger.beside) {
    text += fmt::format(kLine, entry.component, entry.count, entry.bytes);
  }
  text += fmt::format(kLine, "total", "", ledger.total_bytes);
  return text;
}

std::size_t unit_memory_bytes(const MemoryLedger& ledger) {
  const std::size_t all = ledger.total_bytes + kProgramBytes;
  return (all + kMiB - 1) / kMiB * kMiB;
}

std::string unit_limits(const MemoryLedger& ledger) {
  return fmt::format(
      "# Written by mapletd --print-unit-limits for this configuration; put it into\n"
      "# /etc/systemd/system/mapletd.service.d/limits.conf\n"
      "[Service]\n"
      "MemoryMax={}M\n"
      "MemorySwapMax=0\n"
      "LimitMEMLOCK={}M\n"
      "TasksMax={}\n",
      unit_memory_bytes(ledger) / kMiB, (ledger.arena_bytes + 2 * kMiB) / kMiB + 1,
      2 * (kOwnThreads + kDdsThreads));
}

std::optional<std::string> refusal(const Config& config, MemoryParts parts,
                                   std::uint64_t cgroup_limit_bytes) {
  // What the program itself takes is not the arena's to look around in.
  Arena arena{std::max<std::uint64_t>(cgroup_limit_bytes, kProgramBytes + kKiB) - kProgramBytes};
  std::string need;
  std::string_view part;
  try {
    add_stages(arena, config, parts);
  } catch (const ArenaExhausted& e) {
    need = e.what();
    part = "the stages that fit, and what is beside them:\n";
  }
  const MemoryLedger ledger = ledger_of(arena, config, parts);
  const std::size_t bytes = unit_memory_bytes(ledger);
  if (need.empty() && bytes <= cgroup_limit_bytes) return {};
  if (need.empty()) need = fmt::format("{} MiB", bytes / kMiB);
  return fmt::format(
      "the control group allows {} MiB, this configuration needs {}: lower [limits], maplet and "
      "skeleton sizes, or raise MemoryMax (--print-unit-limits writes it)\n{}{}",
      cgroup_limit_bytes / kMiB, need, part, to_text(ledger));
}

}  // namespace maplet::daemon
