// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/log.hpp"

#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/sinks/systemd_sink.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cstdlib>
#include <memory>

namespace maplet::daemon {

namespace {

spdlog::logger& logger() {
  static const std::unique_ptr<spdlog::logger> instance = [] {
    spdlog::sink_ptr sink;
    if (std::getenv("JOURNAL_STREAM") != nullptr) {
      sink = std::make_shared<spdlog::sinks::systemd_sink_mt>("mapletd");
    } else {
      sink = std::make_shared<spdlog::sinks::stderr_sink_mt>();
      // In a terminal a progress bar may stand where the line goes.
      sink->set_pattern(isatty(STDERR_FILENO) == 1 ? "\r\x1b[Kmapletd: %v" : "mapletd: %v");
    }
    return std::make_unique<spdlog::logger>("mapletd", std::move(sink));
  }();
  return *instance;
}

}  // namespace

void log_info(std::string_view line) { logger().info(line); }
void log_warning(std::string_view line) { logger().warn(line); }
void log_error(std::string_view line) { logger().error(line); }

void FewLines::say(std::string_view line) {
  if (left_ == 0) return;
  log_warning(line);
  if (--left_ == 0) log_warning("more of this kind is counted and not said (report, status)");
}

}  // namespace maplet::daemon
