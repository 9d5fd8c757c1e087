// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "daemon/gpio_config.hpp"
#include "daemon/heartbeat.hpp"
#include "drivers/gpio/gpio_line.hpp"
#include "drivers/gpio/pulse_clock.hpp"

namespace maplet::daemon {

/// What the lines say, for the status.
struct GpioStatus {
  bool tracking = false;
  bool heartbeat = false;  ///< it beats
  bool hold = false;
  bool has_pulse = false;
  PulseClock::State pulse;
  std::vector<std::string> problems;  ///< lines that are not used, and why
};

/// The lines to the rest of the robot: tracking and heartbeat out, hold switch and time pulse in.
///
/// The heartbeat stops kStill after the estimator does, with its line off or on as it was: what a
/// watchdog waits for is the change.
///
/// Memory   libgpiod's at open(); none after that.
/// Threads  one of its own ("gpio"); show_tracking(), held() and clock_rate() from the estimator's,
///   without waiting; status() from any.
class GpioPanel {
 public:
  static constexpr Duration kStill = std::chrono::seconds{2};

  GpioPanel(const GpioConfig& config, const Heartbeat& estimator);
  ~GpioPanel();
  GpioPanel(const GpioPanel&) = delete;
  GpioPanel& operator=(const GpioPanel&) = delete;

  /// Takes the lines; the others go on without one that is missing.
  /// @return what is missing, a line each
  [[nodiscard]] std::vector<std::string> open();
  void start();

  void show_tracking(bool on) noexcept;
  [[nodiscard]] bool held() const noexcept { return held_; }
  /// True seconds in a second of our clock.
  [[nodiscard]] double clock_rate() const noexcept { return clock_rate_; }
  [[nodiscard]] GpioStatus status() const;

 private:
  void loop() noexcept;
  [[nodiscard]] Duration patience(Instant now) const noexcept;
  void listen(Duration patience) noexcept;
  void read_hold(Instant now) noexcept;
  void beat(Instant now) noexcept;
  void show() noexcept;
  /// The line is gone: it is not used any more, said once.
  void give_up(std::optional<GpioLine>& line, const std::string& name) noexcept;

  const GpioConfig config_;
  Heartbeat::Look estimator_;
  std::optional<GpioLine> tracking_, heartbeat_, hold_, pulse_;

  // Of the thread alone.
  bool shown_ = false;  ///< what the tracking line says
  bool beat_on_ = false;
  Instant next_beat_{};
  Instant moved_at_{};
  std::optional<Instant> settles_at_;  ///< of the hold switch, since its last edge

  int wake_ = -1;  ///< an eventfd
  std::atomic<bool> wanted_{false};
  std::atomic<bool> beating_{false};
  std::atomic<bool> held_{false};
  std::atomic<double> clock_rate_{1.0};
  std::atomic<bool> stop_{false};
  mutable std::mutex mutex_;  ///< guards what follows
  PulseClock clock_;
  std::vector<std::string> problems_;
  std::thread thread_;
};

}  // namespace maplet::daemon
