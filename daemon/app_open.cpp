// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// mapletd's start: the source, the folder, DDS, the control socket.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "daemon/alloc_counter.hpp"
#include "daemon/app.hpp"
#include "daemon/configure.hpp"
#include "daemon/gray_setup.hpp"
#include "daemon/log.hpp"
#include "daemon/private_tmp.hpp"
#include "daemon/run_setup.hpp"
#include "daemon/service_notify.hpp"
#include "daemon/signals.hpp"
#include "daemon/thread_setup.hpp"
#include "drivers/paired_source.hpp"

namespace maplet::daemon {

int App::open() {
  if (config_.input.source.empty()) {
    log_error("no source: give --source URI, or input.source in the configuration");
    return kExitUsage;
  }
  // A finite run has its source before it touches the folder: a typing error spoils nothing.
  const bool finite = !options_.out.empty();  // of this process
  if (!open_gray()) return kExitFailure;
  if (finite) {
    if (const int exit_code = open_source(false); exit_code != kExitDone) return exit_code;
    auto output = RunOutput::create(options_.out);
    if (!output) {
      log_error(output.error());
      return kExitFailure;
    }
    output_ = std::move(*output);
  }
  if (!open_gpio()) return kExitFailure;
  if (!replayed_ && Neighbours::needed(config_, options_.dds)) {
    neighbours_ =
        std::make_unique<Neighbours>(config_, options_.agent, pace_, options_.dds, board_);
    neighbours_->start();
  }
  open_console();
  supervisor_ = std::make_unique<Supervisor>(heart_, board_, warnings_, [this, finite] {
    if (!finite) reload();
  });
  if (options_.dds) {
    // A loopback that is down is no reason not to map: the radio may still work.
    auto publisher = DdsPublisher::start(config_.dds, options_.agent, DdsPublisher::Missing::kWait,
                                         neighbours_.get());
    if (!publisher) {
      log_error(publisher.error().what);
      return kExitFailure;
    }
    publisher_ = std::move(*publisher);
    if (!publisher_->open()) log_warning("the loopback interface is down: waiting for it (DDS)");
    if (const auto failure = radio_->start(output_ == nullptr)) {
      log_error(failure->what);
      return kExitFailure;
    }
  }
  return finite ? kExitDone : open_source(false);
}

bool App::open_recorder() {
  if (config_.recorder.file.empty() || replayed_) return true;
  const std::size_t pixels = config_.agent.limits.image().pixels();
  auto writer = start_recording(config_, identity_, pace_, radio_ != nullptr, !options_.out.empty(),
                                state_.holds_mission() || !state_.imported().empty());
  if (!writer) {
    log_error("recorder.file: " + writer.error());
    return false;
  }
  if (const std::string tmp = private_tmp_of(config_.recorder.file); !tmp.empty()) {
    log_warning(
        "recorder.file: " + tmp +
        " is this service's own (systemd's PrivateTmp) and goes with it; mapletctl recorder "
        "save copies what is recorded elsewhere");
  }
  // A run at its own pace waits for the recorder's disk; others never do.
  flight_.record(std::move(*writer), pace_ == Pace::kFast, pixels);
  return true;
}

int App::open_source(bool again) {
  if (replayed_) {  // what the run did while it waited for its camera
    while (flight_.take(flight::Event::kMark)) {
      listen(kMeetings);
      settle(Deadline::never());
    }
    if (!source_) source_ = std::make_unique<NoSource>();
    return kExitDone;
  }
  const ThirdPartyScope theirs;  // opening is a driver's business, and rare
  close_source();                // a camera opens once
  set_tracking(false);
  const SourceOptions options = source_options(config_);
  bool said = false;
  while (true) {
    auto opened = [&] {
      const Heartbeat::Waiting waiting{heart_};
      return maplet::open_source(config_.input.source, options);
    }();
    if (opened) {
      if (!has_room_for(**opened)) return kExitUsage;
      take_source(std::move(*opened));
      return kExitDone;
    }
    // A camera that was there comes back, whatever it says while it does.
    const bool may_come =
        (again || opened.error().kind == SourceError::Kind::kAbsent) && options_.out.empty();
    if (!may_come) {
      log_error(opened.error().what);
      return opened.error().kind == SourceError::Kind::kUsage ? kExitUsage : kExitFailure;
    }
    if (!said) {
      log_warning("waiting for a camera: " + opened.error().what);
      notify_ready();
      said = true;
    }
    publish_status(StatusRecord::State::kWaitingForCamera);
    for (int i = 0; i < 5; ++i) {
      if (stop_asked()) return kExitDone;
      heart_.beat();
      flight_.note_mark();
      listen(kMeetings);
      settle(Deadline::never());
      std::this_thread::sleep_for(std::chrono::milliseconds{100});
    }
  }
}

bool App::has_room_for(const DepthSource& source) const {
  const ImageSize largest = config_.agent.limits.image();
  const auto size = source.size();
  if (!size || largest.holds(size->width_px, size->height_px)) return true;
  log_error(fmt::format(
      "{}: its images are {} x {} pixels, and memory is reserved for {} x {}: set "
      "limits.image_width_px = {} and limits.image_height_px = {}",
      config_.input.source, size->width_px, size->height_px, largest.width_px, largest.height_px,
      std::max(size->width_px, largest.width_px), std::max(size->height_px, largest.height_px)));
  return false;
}

SourceCounters App::source_counters() const {
  if (counted_) return *counted_;
  SourceCounters sum = gone_;
  const SourceCounters now = source_ ? source_->counters() : SourceCounters{};
  sum.read += now.read;
  sum.dropped += now.dropped;
  sum.unreadable += now.unreadable;
  sum.out_of_order += now.out_of_order;
  return sum;
}

void App::close_source() {
  gone_ = source_counters();
  capture_ = nullptr;
  source_.reset();
}

void App::take_source(std::unique_ptr<DepthSource> source) {
  if (pace_ == Pace::kFast) {
    source_ = std::move(source);
    return;
  }
  if (gray_) {
    source = std::make_unique<PairedSource>(std::move(source), *gray_, *gray_options(config_.gray));
  }
  const int priority = config_.realtime.capture_priority;
  auto capture = std::make_unique<CaptureThread>(std::move(source), pace_, *frames_, [priority] {
    if (const auto problem = set_up_this_thread("capture", priority)) log_warning(*problem);
  });
  capture_ = capture.get();
  source_ = std::move(capture);
}

bool App::open_gray() {
  if (replayed_ || !config_.gray.used() || pace_ != Pace::kLive) return true;
  auto opened = open_libcamera(*gray_options(config_.gray));
  if (!opened) {
    log_error("gray_camera.source: " + opened.error());
    return false;
  }
  gray_ = std::move(*opened);
  return true;
}

bool App::open_gpio() {
  if (replayed_ || !config_.gpio.used() || pace_ == Pace::kFast) return true;
  gpio_ = std::make_unique<GpioPanel>(config_.gpio, heart_);
  for (const std::string& missing : gpio_->open()) {
    if (config_.gpio.required) {
      log_error(missing + " (gpio.required)");
      return false;
    }
    log_warning(missing);
  }
  gpio_->start();
  return true;
}

bool App::allowed(const std::optional<std::string>& problem) {
  if (!problem) return true;
  if (!config_.realtime.required) {
    log_warning(*problem);
    return true;
  }
  log_error(*problem + " (realtime.required)");
  return false;
}

void App::reload() {
  const auto wanted = configure(options_);
  if (!wanted) {
    log_error("the configuration stays as it was: " + wanted.error());
    return;
  }
  log_info("configuration read again: " + to_line(live_.take(*wanted)));
  if (radio_ && radio_->security() != nullptr) radio_->security()->reload();
}

void App::open_console() {
  if (config_.control.socket == "none" || replayed_) return;
  console_ = std::make_unique<Console>(
      Console::Subjects{identity_, board_, *memory_, live_, radio_.get(), gpio_.get(), gray_.get(),
                        journal_.get(), &state_, &flight_, neighbours_.get()},
      static_cast<std::size_t>(config_.agent.skeleton.max_nodes));
  if (const std::string problem = console_->open(config_.control.socket); !problem.empty()) {
    log_warning(problem);
    console_.reset();
  }
}

}  // namespace maplet::daemon
