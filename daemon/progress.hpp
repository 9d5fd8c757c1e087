// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string_view>

namespace maplet {

/// A progress bar on standard error with rate and time left; silent when that is no terminal.
///
///   room  [##########----------]  52 %  1484/2857   87.3/s   0:15 left
///
/// Memory   no heap.
/// Time     a look at the clock; draws at most ten times a second.
class Progress {
 public:
  /// @param what   must outlive the bar
  /// @param total  nothing: counts without an end in sight
  Progress(std::string_view what, std::optional<std::uint64_t> total) noexcept;
  ~Progress() { clear(); }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void show(std::uint64_t done) noexcept;
  /// Takes the line away, for other output; the next show() draws it again.
  void clear() noexcept;

 private:
  using Clock = std::chrono::steady_clock;

  std::string_view what_;
  std::optional<std::uint64_t> total_;
  bool terminal_;
  bool drawn_ = false;
  Clock::time_point start_;
  Clock::time_point next_;
};

}  // namespace maplet
