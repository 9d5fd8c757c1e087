// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/log.hpp"

#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/sinks/systemd_sink.h>
#include <spdlog/spdlog.h>

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
      sink->set_pattern("mapletd: %v");
    }
    return std::make_unique<spdlog::logger>("mapletd", std::move(sink));
  }();
  return *instance;
}

}  // namespace

void log_info(std::string_view line) { logger().info(line); }
void log_warning(std::string_view line) { logger().warn(line); }
void log_error(std::string_view line) { logger().error(line); }

}  // namespace maplet::daemon
