// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/progress.hpp"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstring>

namespace maplet {
namespace {

constexpr auto kPeriod = std::chrono::milliseconds{100};
constexpr int kBarChars = 24;

/// Of the terminal; what the line may fill without wrapping.
std::size_t columns() noexcept {
  winsize size{};
  return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 1 ? size.ws_col - 1u : 79u;
}

/// "1:05" or "2:00:05".
void format_time(double seconds, char* out, std::size_t size) noexcept {
  const int whole = static_cast<int>(std::clamp(seconds, 0.0, 359999.0));
  if (whole >= 3600) {
    std::snprintf(out, size, "%d:%02d:%02d", whole / 3600, whole / 60 % 60, whole % 60);
  } else {
    std::snprintf(out, size, "%d:%02d", whole / 60, whole % 60);
  }
}

void draw(const char* line) noexcept {
  std::fprintf(stderr, "\r%.*s\x1b[K", static_cast<int>(std::min(columns(), std::strlen(line))),
               line);
}

}  // namespace

Progress::Progress(std::string_view what, std::optional<std::uint64_t> total) noexcept
    : what_{what},
      total_{total},
      terminal_{isatty(STDERR_FILENO) == 1},
      start_{Clock::now()},
      next_{start_} {}

void Progress::show(std::uint64_t done) noexcept {
  if (!terminal_) return;
  const auto now = Clock::now();
  const bool last = total_ && done >= *total_;
  if (now < next_ && !last) return;
  next_ = now + kPeriod;
  drawn_ = true;
  const double seconds = std::chrono::duration<double>(now - start_).count();
  const double rate = seconds > 0.0 ? static_cast<double>(done) / seconds : 0.0;
  const auto width = static_cast<int>(std::min<std::size_t>(what_.size(), 30));
  char line[200];
  if (!total_ || *total_ == 0) {
    std::snprintf(line, sizeof line, "%.*s  %llu  %6.1f/s", width, what_.data(),
                  static_cast<unsigned long long>(done), rate);
    draw(line);
    return;
  }
  const double share = std::min(1.0, static_cast<double>(done) / static_cast<double>(*total_));
  char bar[kBarChars + 1];
  const auto filled = static_cast<std::size_t>(share * kBarChars);
  std::memset(bar, '#', filled);
  std::memset(bar + filled, '-', kBarChars - filled);
  bar[kBarChars] = '\0';
  char left[40] = "?";
  if (rate > 0.0) {
    format_time(static_cast<double>(*total_ - std::min(done, *total_)) / rate, left, sizeof left);
  }
  std::snprintf(line, sizeof line, "%.*s  [%s] %3d %%  %llu/%llu  %6.1f/s  %s left", width,
                what_.data(), bar, static_cast<int>(100.0 * share),
                static_cast<unsigned long long>(done), static_cast<unsigned long long>(*total_),
                rate, left);
  draw(line);
}

void Progress::clear() noexcept {
  if (!drawn_) return;
  std::fputs("\r\x1b[K", stderr);
  drawn_ = false;
}

}  // namespace maplet
