// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// mapletd: depth frames in; track, maplets, delta-poses and skeleton out.
#include <fmt/format.h>
#include <malloc.h>

#include <cstdio>
#include <exception>
#include <limits>
#include <new>

#include "core/base/arena_exhausted.hpp"
#include "daemon/app.hpp"
#include "daemon/config_io.hpp"
#include "daemon/configure.hpp"
#include "daemon/log.hpp"
#include "daemon/memory_ledger.hpp"
#include "daemon/memory_status.hpp"
#include "daemon/options.hpp"
#include "daemon/security_setup.hpp"

namespace {

using namespace maplet::daemon;

int run(const Options& options, const Config& config) {
  const std::uint64_t bytes = static_cast<std::uint64_t>(config.journal.size_mib) << 20;
  auto flight = open_flight(config);
  if (!flight) {
    fmt::print(stderr, "mapletd: {}\n", flight.error());
    return kExitFailure;
  }
  const bool replays = flight->has_value();  // what ran went without, or with its own
  auto state = StateDirectory::open(replays ? "" : options.state, options.agent, bytes);
  if (!state) {
    fmt::print(stderr, "mapletd: {}\n", state.error().what);
    return state.error().usage ? kExitUsage : kExitFailure;
  }
  log_as(replays ? (*flight)->identity.agent : options.agent);
  if (replays) {
    for (const std::string& line : without_effect(options, config, **flight)) log_warning(line);
  }
  Options how = options;
  if (replays) how.dds = false;
  auto security = how.dds ? open_security(config, options.agent, state->path()) : std::nullopt;
  if (!security) {
    fmt::print(stderr, "mapletd: {}\n", security.error());
    return kExitUsage;
  }
  if (*security) {
    for (const std::string& line : (*security)->said) log_warning("security: " + line);
  }
  return App{how, config, std::move(*state), std::move(*flight), *security}.run();
}

int run(int argc, char** argv) {
  Options options;
  if (const int exit_code = parse_options(argc, argv, options); exit_code >= 0) return exit_code;
  if (is_record(options.source)) {
    if (const std::string problem = flight_problem(options.source); !problem.empty()) {
      fmt::print(stderr, "mapletd: {}\n", problem);
      return kExitFailure;
    }
  }
  const auto config = configure(options);
  if (!config) {
    fmt::print(stderr, "mapletd: {}\n", config.error());
    return kExitUsage;
  }
  switch (options.action) {
    case Options::Action::kCheckConfig:
      (void)memory_ledger(*config, options.parts());  // it fits
      fmt::print("configuration is valid\n");
      return kExitDone;
    case Options::Action::kPrintConfig:
      fmt::print("{}", print_config(*config));
      return kExitDone;
    case Options::Action::kPrintMemory:
      fmt::print("{}", to_text(memory_ledger(*config, options.parts())));
      return kExitDone;
    case Options::Action::kPrintUnitLimits:
      // The unit has a StateDirectory, so a journal.
      fmt::print("{}", unit_limits(memory_ledger(*config, {options.dds, true})));
      return kExitDone;
    case Options::Action::kRun:
      if (const auto limit = cgroup_memory_limit()) {
        if (const auto why = refusal(*config, options.parts(), *limit)) {
          fmt::print(stderr, "mapletd: {}", *why);
          return kExitUsage;
        }
      }
      return run(options, *config);
  }
  return kExitUsage;
}

}  // namespace

int main(int argc, char** argv) {
  // One heap for all threads: those of OpenNI2 and Cyclone come and go with cameras and agents, and
  // each would leave a heap of its own behind. Ours ask for nothing once they run, so nobody waits
  // for its lock.
  mallopt(M_ARENA_MAX, 1);
  // What is large is mapped and goes back when it is freed, what is small stays: left to itself
  // malloc moves that border and hands the top of the heap back and takes it again with each
  // camera.
  mallopt(M_MMAP_THRESHOLD, 128 << 10);
  mallopt(M_TRIM_THRESHOLD, std::numeric_limits<int>::max());
  try {
    return run(argc, argv);
  } catch (const maplet::ArenaExhausted& e) {
    std::fprintf(stderr,
                 "mapletd: configuration: the stages would need %s; lower the limits, maplet and "
                 "skeleton sizes (mapletd --print-memory shows what each takes)\n",
                 e.what());
    return kExitUsage;
  } catch (const std::bad_alloc&) {
    std::fputs("mapletd: not enough memory or address space (ulimit -v, MemoryMax) to start\n",
               stderr);
    return kExitFailure;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "mapletd: %s\n", e.what());
    return kExitFailure;
  }
}
