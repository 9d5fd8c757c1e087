// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <boost/lockfree/spsc_queue.hpp>
#include <string_view>

#include "core/base/clock.hpp"
#include "drivers/line.hpp"

namespace maplet::daemon {

/// One line each: what, where, what to do. To the journal when systemd started us, else to standard
/// error as `mapletd: ...`. Allocates: not for the frame path.
/// The journal's field MAPLETD_AGENT from now on.
void log_as(int of_agent);
void log_info(std::string_view line);
void log_warning(std::string_view line);
void log_error(std::string_view line);

/// Warnings of the frame path that could go on for ever: ten at once, then one more every ten
/// seconds; the rest is counted by whoever reports.
///
/// Memory   64 lines. Threads  say() by one, without waiting and allocation; flush() by another.
class FewLines {
 public:
  FewLines();
  void say(std::string_view line) noexcept;
  /// Writes what was said.
  void flush();

 private:
  static constexpr int kAtOnce = 10;
  boost::lockfree::spsc_queue<Line> lines_;
  MonotonicClock clock_;
  double left_ = kAtOnce;
  Instant refilled_;
};

}  // namespace maplet::daemon
