// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// mapletd: depth frames in; track, maplets, delta-poses and skeleton out.
#include <fmt/format.h>

#include <cstdio>
#include <exception>
#include <new>

#include "core/base/arena_exhausted.hpp"
#include "daemon/app.hpp"
#include "daemon/config_io.hpp"
#include "daemon/configure.hpp"
#include "daemon/memory_ledger.hpp"
#include "daemon/memory_status.hpp"
#include "daemon/options.hpp"

namespace {

using namespace maplet::daemon;

int run(int argc, char** argv) {
  Options options;
  if (const int exit_code = parse_options(argc, argv, options); exit_code >= 0) return exit_code;
  const auto config = configure(options);
  if (!config) {
    fmt::print(stderr, "mapletd: {}\n", config.error());
    return kExitUsage;
  }
  switch (options.action) {
    case Options::Action::kCheckConfig:
      (void)memory_ledger(*config, options.dds);  // it fits
      fmt::print("configuration is valid\n");
      return kExitDone;
    case Options::Action::kPrintConfig:
      fmt::print("{}", print_config(*config));
      return kExitDone;
    case Options::Action::kPrintMemory:
      fmt::print("{}", to_text(memory_ledger(*config, options.dds)));
      return kExitDone;
    case Options::Action::kPrintUnitLimits:
      fmt::print("{}", unit_limits(memory_ledger(*config, options.dds)));
      return kExitDone;
    case Options::Action::kRun:
      if (const auto limit = cgroup_memory_limit()) {
        if (const auto why = refusal(*config, options.dds, *limit)) {
          fmt::print(stderr, "mapletd: {}\n", *why);
          return kExitUsage;
        }
      }
      return App{options, *config}.run();
  }
  return kExitUsage;
}

}  // namespace

int main(int argc, char** argv) {
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
