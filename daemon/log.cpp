// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/log.hpp"

#define SD_JOURNAL_SUPPRESS_LOCATION  // it would be this file for every line
#include <spdlog/sinks/base_sink.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>
#include <syslog.h>
#include <systemd/sd-journal.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <mutex>

namespace maplet::daemon {

namespace {

std::atomic<int> agent{0};

/// The system's journal, with fields to search by: docs/service.md.
class JournalSink final : public spdlog::sinks::base_sink<std::mutex> {
  void sink_it_(const spdlog::details::log_msg& said) override {
    const int priority = said.level >= spdlog::level::err    ? LOG_ERR
                         : said.level == spdlog::level::warn ? LOG_WARNING
                                                             : LOG_INFO;
    (void)sd_journal_send("MESSAGE=%.*s", static_cast<int>(said.payload.size()),
                          said.payload.data(), "PRIORITY=%d", priority, "SYSLOG_IDENTIFIER=mapletd",
                          "MAPLETD_AGENT=%d", agent.load(), "MAPLETD_VERSION=" MAPLET_VERSION,
                          nullptr);
  }
  void flush_() override {}
};

/// Whether standard error goes to the journal. The variable alone does not tell: what a service
/// starts inherits it, a desktop's terminal too.
bool to_journal() {
  const char* stream = std::getenv("JOURNAL_STREAM");
  unsigned long long device = 0;
  unsigned long long inode = 0;
  struct stat error {};
  return stream != nullptr && std::sscanf(stream, "%llu:%llu", &device, &inode) == 2 &&
         fstat(STDERR_FILENO, &error) == 0 && error.st_dev == device && error.st_ino == inode;
}

spdlog::logger& logger() {
  static const std::unique_ptr<spdlog::logger> instance = [] {
    spdlog::sink_ptr sink;
    if (to_journal()) {
      sink = std::make_shared<JournalSink>();
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

void log_as(int of_agent) { agent = of_agent; }
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
