// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/gpio_panel.hpp"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>

#include "daemon/log.hpp"
#include "daemon/thread_setup.hpp"

namespace maplet::daemon {

namespace {

using std::chrono::milliseconds;
constexpr Duration kLook = milliseconds{500};  // without anything to do

}  // namespace

GpioPanel::GpioPanel(const GpioConfig& config, const Heartbeat& estimator)
    : config_{config}, estimator_{estimator}, wake_{eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)} {}

GpioPanel::~GpioPanel() {
  stop_ = true;
  show_tracking(false);
  if (thread_.joinable()) thread_.join();
  if (tracking_) (void)tracking_->set(false);
  if (wake_ >= 0) ::close(wake_);
}

std::vector<std::string> GpioPanel::open() {
  std::vector<std::string> missing;
  const auto take = [&](std::optional<GpioLine>& line, const std::string& where, bool active_low,
                        GpioLine::Use use) {
    if (where.empty()) return;
    auto opened = GpioLine::open(where, active_low, use);
    if (opened) {
      line = std::move(*opened);
    } else {
      missing.push_back(opened.error());
    }
  };
  take(tracking_, config_.tracking, config_.tracking_active_low, GpioLine::Use::kOutput);
  take(heartbeat_, config_.heartbeat, config_.heartbeat_active_low, GpioLine::Use::kOutput);
  take(hold_, config_.hold, config_.hold_active_low, GpioLine::Use::kInput);
  take(pulse_, config_.pulse, config_.pulse_active_low, GpioLine::Use::kInput);
  problems_ = missing;
  if (hold_) held_ = hold_->value().value_or(false);
  return missing;
}

void GpioPanel::start() {
  thread_ = start_thread("gpio", [this] { loop(); });
}

void GpioPanel::show_tracking(bool on) noexcept {
  wanted_ = on;
  const std::uint64_t one = 1;
  (void)!::write(wake_, &one, sizeof one);
}

GpioStatus GpioPanel::status() const {
  GpioStatus status;
  status.tracking = wanted_;
  status.heartbeat = beating_;
  status.hold = held_;
  status.has_pulse = !config_.pulse.empty();
  const std::scoped_lock lock{mutex_};
  status.pulse = clock_.state(MonotonicClock{}.now());
  status.problems = problems_;
  return status;
}

void GpioPanel::loop() noexcept {
  const MonotonicClock clock;
  moved_at_ = next_beat_ = clock.now();
  while (!stop_) {
    show();
    beat(clock.now());
    listen(patience(clock.now()));
    read_hold(clock.now());
  }
}

Duration GpioPanel::patience(Instant now) const noexcept {
  Instant next = now + kLook;
  if (heartbeat_) next = std::min(next, next_beat_);
  if (settles_at_) next = std::min(next, *settles_at_);
  return std::max(next - now, Duration{0});
}

void GpioPanel::listen(Duration patience) noexcept {
  std::array<pollfd, 3> ears{};
  ears[0] = {wake_, POLLIN, 0};
  ears[1] = {hold_ ? hold_->event_fd() : -1, POLLIN, 0};
  ears[2] = {pulse_ ? pulse_->event_fd() : -1, POLLIN, 0};
  const timespec limit{static_cast<time_t>(patience / std::chrono::seconds{1}),
                       static_cast<long>((patience % std::chrono::seconds{1}).count())};
  if (ppoll(ears.data(), ears.size(), &limit, nullptr) <= 0) return;
  if (ears[0].revents != 0) {
    std::uint64_t ignored = 0;
    (void)!::read(wake_, &ignored, sizeof ignored);
  }
  if (ears[1].revents != 0) {
    const auto edge = (ears[1].revents & POLLIN) != 0 ? hold_->read_edge() : std::nullopt;
    if (edge) {
      settles_at_ = MonotonicClock{}.now() + config_.hold_debounce;
    } else {
      give_up(hold_, config_.hold);
    }
  }
  if (ears[2].revents == 0) return;
  const auto edge = (ears[2].revents & POLLIN) != 0 ? pulse_->read_edge() : std::nullopt;
  if (!edge) return give_up(pulse_, config_.pulse);
  if (!edge->on) return;
  const std::scoped_lock lock{mutex_};
  clock_.pulse(edge->at);
  clock_rate_ = clock_.rate();
}

void GpioPanel::read_hold(Instant now) noexcept {
  if (!settles_at_ || now < *settles_at_ || !hold_) return;
  settles_at_.reset();
  const auto value = hold_->value();
  if (!value) return give_up(hold_, config_.hold);
  if (held_ == *value) return;
  held_ = *value;
  log_info(*value ? "held by the switch at " + config_.hold
                  : "the switch at " + config_.hold + " lets it go on");
}

void GpioPanel::beat(Instant now) noexcept {
  if (estimator_.moved_on()) moved_at_ = now;
  beating_ = heartbeat_ && now - moved_at_ < kStill;
  if (!heartbeat_ || now < next_beat_) return;
  const Duration half{std::llround(0.5e9 / config_.heartbeat_hz)};
  next_beat_ += half;  // no drift
  if (next_beat_ <= now) next_beat_ = now + half;
  if (!beating_) return;
  beat_on_ = !beat_on_;
  if (!heartbeat_->set(beat_on_)) give_up(heartbeat_, config_.heartbeat);
}

void GpioPanel::show() noexcept {
  const bool wanted = wanted_;
  if (!tracking_ || wanted == shown_) return;
  shown_ = wanted;
  if (!tracking_->set(wanted)) give_up(tracking_, config_.tracking);
}

void GpioPanel::give_up(std::optional<GpioLine>& line, const std::string& name) noexcept {
  line.reset();
  const std::string said = "GPIO line '" + name + "': the chip is gone; restart when it is back";
  log_warning(said);
  const std::scoped_lock lock{mutex_};
  problems_.push_back(said);
}

}  // namespace maplet::daemon
