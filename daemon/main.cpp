// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// mapletd: depth frames in; track, maplets, delta-poses and skeleton out.
#include <fmt/format.h>

#include <cstdio>
#include <exception>
#include <new>

#include "core/base/arena_exhausted.hpp"
#include "daemon/app.hpp"
#include "daemon/config_io.hpp"
#include "daemon/memory_ledger.hpp"
#include "daemon/options.hpp"
#include "drivers/open_source.hpp"

namespace {

using namespace maplet::daemon;

tl::expected<Config, ConfigError> configure(const Options& options) {
  auto config = options.config_file.empty() ? tl::expected<Config, ConfigError>{Config{}}
                                            : load_config(options.config_file);
  for (const std::string& assignment : options.overrides) {
    if (!config) break;
    if (const auto set = set_key(*config, assignment); !set) return tl::unexpected{set.error()};
  }
  if (config && !options.source.empty()) config->input.source = options.source;
  if (config && !config->input.source.empty()) {
    if (const auto uri = maplet::check_source(config->input.source); !uri) {
      return tl::unexpected{uri.error()};
    }
  }
  if (config) {
    if (const auto checked = check_together(*config); !checked) {
      const std::string where = options.config_file.empty() ? "" : options.config_file + ": ";
      return tl::unexpected{where + checked.error()};
    }
  }
  return config;
}

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
      (void)memory_ledger(*config);  // it fits
      fmt::print("configuration is valid\n");
      return kExitDone;
    case Options::Action::kPrintConfig:
      fmt::print("{}", print_config(*config));
      return kExitDone;
    case Options::Action::kPrintMemory:
      fmt::print("{}", memory_ledger(*config));
      return kExitDone;
    case Options::Action::kRun:
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
