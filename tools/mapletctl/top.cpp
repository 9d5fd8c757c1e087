// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// A live view of a running daemon.
#include <fmt/core.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <memory>
#include <string>
#include <thread>

#include "tools/mapletctl/ask.hpp"
#include "tools/mapletctl/status_text.hpp"

namespace maplet::ctl {

namespace {

using Json = nlohmann::ordered_json;

struct Options {
  Daemon daemon;
  double every_s = 1.0;
  int count = 0;
};

volatile std::sig_atomic_t stop_asked = 0;

constexpr int kBar = 24;

/// "#####-------------------" for a share of the whole.
std::string bar(double share) {
  const int full = std::min(kBar, static_cast<int>(share * kBar + 0.5));
  return std::string(static_cast<std::size_t>(full), '#') +
         std::string(static_cast<std::size_t>(kBar - full), '-');
}

void show(const Json& now, const Json& before, double elapsed_s) {
  print_status(now);
  const auto processed = [](const Json& s) { return s["frames"]["processed"].get<double>(); };
  if (!before.is_null() && elapsed_s > 0.0) {
    fmt::print("rate      {:.1f} frames/s\n", (processed(now) - processed(before)) / elapsed_s);
  }
  double most = 1.0;
  for (const auto& [stage, time] : now["stages"].items()) {
    if (stage != "source") most = std::max(most, time["p99_us"].get<double>());
  }
  fmt::print("\n{:<14}{:>9}{:>9}{:>9}{:>8}\n", "stage (CPU)", "p50 ms", "p99 ms", "max ms",
             "misses");
  for (const auto& [stage, time] : now["stages"].items()) {
    fmt::print("{:<14}{:9.2f}{:9.2f}{:9.2f}{:8}  {}\n", stage, time["p50_us"].get<double>() / 1e3,
               time["p99_us"].get<double>() / 1e3, time["max_us"].get<double>() / 1e3,
               time["deadline_misses"].get<std::int64_t>(),
               bar(time["p99_us"].get<double>() / most));
  }
  std::fflush(stdout);
}

void run(const Options& options) {
  std::signal(SIGINT, [](int) { stop_asked = 1; });
  const bool terminal = isatty(STDOUT_FILENO) == 1;
  const std::chrono::duration<double> pause{options.every_s};
  Json before;
  auto at = std::chrono::steady_clock::now();
  for (int i = 0; stop_asked == 0 && (options.count == 0 || i < options.count); ++i) {
    if (i > 0) std::this_thread::sleep_for(pause);
    const Json now = ask(options.daemon, {{"command", "status"}});
    const auto asked = std::chrono::steady_clock::now();
    if (terminal) fmt::print("\x1b[H\x1b[2J");
    show(now, before, std::chrono::duration<double>(asked - at).count());
    if (!terminal) fmt::print("\n");
    before = now;
    at = asked;
  }
}

}  // namespace

void add_top(Command app) {
  auto options = std::make_shared<Options>();
  const Command sub =
      app.add_command("top", "Watches a running daemon: rates, stages, memory, peers");
  add_daemon_options(sub, std::shared_ptr<Daemon>{options, &options->daemon});
  sub.add_option("--every-s", options->every_s, "between two looks")
      .range(0.1, 3600.0)
      .show_default();
  sub.add_option("--count", options->count, "ends after so many looks; 0 = Ctrl-C ends it")
      .non_negative();
  sub.run([options] { run(*options); });
}

}  // namespace maplet::ctl
