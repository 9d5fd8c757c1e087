// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/log.hpp"

#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/sinks/systemd_sink.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
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

FewLines::FewLines() : lines_{64}, refilled_{clock_.now()} {}

void FewLines::say(std::string_view line) noexcept {
  constexpr double kPerSecond = 0.1;
  const Instant now = clock_.now();
  left_ = std::min<double>(kAtOnce, left_ + kPerSecond * seconds(now - refilled_));
  refilled_ = now;
  if (left_ < 1.0) return;
  left_ -= 1.0;
  (void)lines_.push(Line{line.data(), std::min(line.size(), kMaxLineBytes)});
  if (left_ < 1.0) {
    constexpr std::string_view kMore = "more of this kind is counted, and said now and then";
    (void)lines_.push(Line{kMore.data(), kMore.size()});
  }
}

void FewLines::flush() {
  lines_.consume_all([](const Line& line) { log_warning(view(line)); });
}

}  // namespace maplet::daemon
