// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/app.hpp"

#include <fmt/format.h>

#include <atomic>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <random>
#include <thread>

#include "core/base/crc.hpp"
#include "core/frame/sensor_kind.hpp"
#include "daemon/alloc_counter.hpp"
#include "daemon/config_io.hpp"
#include "daemon/log.hpp"
#include "daemon/mapletctl_call.hpp"
#include "daemon/progress.hpp"
#include "daemon/report.hpp"
#include "daemon/service_notify.hpp"
#include "drivers/content_mark.hpp"
#include "drivers/open_source.hpp"
#include "transport/exchange/json.hpp"

namespace maplet::daemon {

namespace {

using namespace std::chrono_literals;

constexpr Duration kFlushTime = 3s;
constexpr int kMeetings = 8;  // steps of looking for common places, while no frame waits

std::atomic<bool> stop_asked{false};

extern "C" void on_signal(int) { stop_asked = true; }

void catch_signals() {
  struct sigaction action {};
  action.sa_handler = on_signal;
  sigaction(SIGTERM, &action, nullptr);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGHUP, &action, nullptr);
  signal(SIGPIPE, SIG_IGN);
}

bool is_recording(std::string_view uri) {
  return !uri.starts_with("openni2:") || uri.find(".oni") != std::string_view::npos;
}

Pacer::Mode pace_of(const Options& options, const Config& config) {
  if (!is_recording(config.input.source)) return Pacer::Mode::kLive;
  return options.pace == Options::Pace::kFast ? Pacer::Mode::kFast : Pacer::Mode::kRecorded;
}

/// docs/adr/0001: a replay's epoch is derived from everything that decides its bytes.
std::uint32_t epoch_of(const Options& options, const Config& config) {
  if (pace_of(options, config) != Pacer::Mode::kFast) return std::random_device{}();
  Config content = config;  // without where the source lies and where the records go
  content.input.source.clear();
  content.dds = {};
  const std::string all = fmt::format("{}\n{}\n{:08x}\n{}", MAPLET_VERSION, options.agent,
                                      content_mark(config.input.source), print_config(content));
  return crc32c(std::as_bytes(std::span{all}));
}

MapletRecord record_of(const MapletCut& closed) {
  return {closed.maplet.key, closed.maplet.stamp,
          static_cast<std::uint16_t>(closed.maplet.planes.size()),
          static_cast<std::uint16_t>(closed.maplet.keyframes.size()), closed.bytes};
}

/// What the configuration leaves at 0 is that of a typical sensor of the kind.
NoiseModel noise_model(const CameraConfig& c) {
  NoiseModel model = typical_noise(*sensor_kind(c.noise));
  if (c.disparity_k > 0.0) model.disparity_k = c.disparity_k;
  if (c.tof_floor_m > 0.0) model.tof_floor_m = c.tof_floor_m;
  if (c.tof_slope > 0.0) model.tof_slope = c.tof_slope;
  if (c.correlated_px > 0.0) model.correlated_px = c.correlated_px;
  return model;
}

SourceOptions source_options(const Config& config) {
  const CameraConfig& c = config.camera;
  SourceOptions options;
  options.camera = {c.width_px, c.height_px, c.fx_px, c.fy_px, c.cx_px, c.cy_px};
  options.metres_per_unit = c.metres_per_unit;
  options.registered_to_colour = c.registered_to_colour;
  options.gray = config.input.gray == "auto";
  options.noise = noise_model(c);
  return options;
}

/// A source's URI without its query, and of a path only its last part: "sim:loop", "redkitchen_a".
std::string short_name(const std::string& uri) {
  std::string name = uri.substr(0, uri.find('?'));
  if (name.starts_with("tum:")) name = std::filesystem::weakly_canonical(name.substr(4)).string();
  while (name.size() > 1 && name.back() == '/') name.pop_back();
  const auto slash = name.find_last_of('/');
  return slash == std::string::npos ? name : name.substr(slash + 1);
}

}  // namespace

App::App(const Options& options, const Config& config)
    : options_{options},
      config_{config},
      identity_{options.agent, epoch_of(options, config)},
      records_{identity_},
      agent_{arena_.make<Agent>("agent", config.agent, identity_, meters_, records_, arena_)},
      pacer_{pace_of(options, config)},
      start_{monotonic_.now()} {
  if (options.dds) radio_ = std::make_unique<RadioLink>(config, identity_, arena_);
  if (!arena_.seal(true)) log_warning("memory is not locked: grant LimitMEMLOCK (ulimit -l)");
}

App::~App() = default;

int App::run() {
  catch_signals();
  if (const int exit_code = open(); exit_code != kExitDone) return exit_code;
  watch_this_thread();
  start_counting_allocations();
  notify_ready();
  const bool ended_well = loop();
  stop_counting_allocations();
  notify_stopping();
  totals_.complete = ended_well && !stop_asked;
  if (stop_asked && output_) {
    log_warning(fmt::format("stopped by a signal after {} frames; the folder has what was done",
                            totals_.processed));
  }
  const int finished = finish();
  return ended_well ? finished : kExitFailure;
}

int App::open() {
  if (config_.input.source.empty()) {
    log_error("no source: give --source URI, or input.source in the configuration");
    return kExitUsage;
  }
  // A finite run has its source before it touches the folder: a typing error spoils nothing.
  const bool finite = !options_.out.empty();
  if (finite) {
    if (const int exit_code = open_source(); exit_code != kExitDone) return exit_code;
    auto output = RunOutput::create(options_.out);
    if (!output) {
      log_error(output.error());
      return kExitFailure;
    }
    output_ = std::move(*output);
  }
  open_console();
  if (options_.dds) {
    // A loopback that is down is no reason not to map: the radio may still work.
    auto publisher = DdsPublisher::start(config_.dds, options_.agent, DdsPublisher::Missing::kWait);
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
  return finite ? kExitDone : open_source();
}

int App::open_source() {
  const SourceOptions options = source_options(config_);
  bool said = false;
  while (true) {
    auto opened = maplet::open_source(config_.input.source, options);
    if (opened) {
      source_ = std::move(*opened);
      return kExitDone;
    }
    const bool may_come = opened.error().kind == SourceError::Kind::kAbsent && options_.out.empty();
    if (!may_come) {
      log_error(opened.error().what);
      return opened.error().kind == SourceError::Kind::kUsage ? kExitUsage : kExitFailure;
    }
    if (!said) {
      log_warning("waiting for a camera: " + opened.error().what);
      notify_ready();
      notify_status("waiting for a camera");
      said = true;
    }
    publish_status(StatusRecord::State::kWaitingForCamera);
    for (int i = 0; i < 10; ++i) {
      if (stop_asked) return kExitDone;
      listen(kMeetings);
      std::this_thread::sleep_for(std::chrono::milliseconds{100});
    }
  }
}

bool App::loop() {
  Progress progress{"mapping", source_ ? source_->length() : std::nullopt};
  while (!stop_asked) {
    DepthFrame frame;
    switch (read(frame)) {
      case Read::kEnd:
        if (!output_) rest();
        return true;
      case Read::kFailed:
        if (output_ || open_source() != kExitDone) return false;
        break;
      case Read::kNothing:
        break;
      case Read::kFrame:
        if (pacer_.wait(frame.stamp, stop_asked)) {
          process(frame);
        } else {
          ++totals_.dropped;
        }
        progress.show(source_->counters().read);
    }
  }
  return true;
}

App::Read App::read(DepthFrame& frame) {
  constexpr Duration kPatience = std::chrono::seconds{1};
  constexpr int kMaxTimeouts = 5;  // a finite run does not wait for ever
  const StageScope scope{meters_, Stage::kSource, kPatience};
  const ThirdPartyScope theirs;  // decoding a recording allocates in its libraries
  const auto next = source_->next(Deadline{monotonic_, kPatience});
  say_detail();
  if (next) {
    frame = *next;
    timeouts_ = 0;
    return Read::kFrame;
  }
  switch (next.error().code) {
    case ErrorCode::kEnd:
      return Read::kEnd;
    case ErrorCode::kTimeout:
      if (++timeouts_ < kMaxTimeouts || !output_) return Read::kNothing;
      log_error(config_.input.source + ": no frame for 5 s; check the device or the recording");
      return Read::kFailed;
    default:
      log_error(fmt::format("{}: {}", config_.input.source, next.error().what));
      return Read::kFailed;
  }
}

void App::process(const DepthFrame& frame) {
  const Duration budget = config_.agent.frame.budget;
  Step step;
  {
    const StageScope scope{meters_, Stage::kFrame, budget};
    step = agent_->step(frame, pacer_.deadline(budget));
  }
  last_stamp_ = frame.stamp;
  say_tracking(step.track);
  totals_.add(step);
  if (output_) output_->frame(step);
  hand_out(step.closed);
  listen(1);
  if (monotonic_.now() - last_status_ >= std::chrono::seconds{1}) {
    publish_status(StatusRecord::State::kRunning);
  }
}

// A finite run waits for room in the publisher's queue, so that every line of its files goes out;
// the service never waits, and the publisher counts what it had to refuse.
template <class Record>
void App::publish(const Record& record) {
  if (!publisher_) return;
  constexpr int kTries = 1000;
  for (int i = 0; !publisher_->publish(record) && output_ && i < kTries; ++i) {
    std::this_thread::sleep_for(1ms);
  }
}

void App::hand_out(const MapletCut* closed) {
  const StageScope scope{meters_, Stage::kExchange, config_.agent.frame.budget};
  if (closed != nullptr) {
    if (output_) output_->maplet(*closed);
    publish(record_of(*closed));
    if (radio_) (void)radio_->publish(closed->maplet.key, closed->bytes, 0.5F);
  }
  for (const DeltaPoseRecord& record : records_.pending()) {
    totals_.add(record.kind);
    if (output_) {
      const JsonLine line = to_json(record);
      output_->delta_pose({line.data(), line.size()});
    }
    publish(record);
    if (radio_) (void)radio_->publish(record);
  }
  records_.clear_pending();
}

void App::open_console() {
  if (config_.control.socket == "none") return;
  console_ = std::make_unique<Console>(identity_, radio_.get());
  if (const std::string problem = console_->open(config_.control.socket); !problem.empty()) {
    log_warning(problem);
    console_.reset();
  }
}

void App::listen(int meetings) {
  if (console_) console_->attend(*agent_, Deadline::never());
  if (!radio_) return;
  constexpr int kAtOnce = 16;
  radio_->set_record_clock(last_stamp_);
  const StageScope scope{meters_, Stage::kExchange, config_.agent.frame.budget};
  const Deadline deadline = pacer_.deadline(config_.agent.frame.budget);
  DeltaPoseRecord record;
  for (int i = 0; i < kAtOnce && radio_->heard(record); ++i) {
    (void)agent_->hear(restore(record), deadline);
  }
  MapletKey key;
  if (const std::size_t bytes = radio_->heard_maplet(key, maplet_bytes_)) {
    (void)agent_->hear(key, std::span{maplet_bytes_}.first(bytes));
  }
  for (int i = 0; i < meetings; ++i) {
    const bool more = agent_->meet(deadline);
    hand_out(nullptr);
    if (!more) break;
    radio_->stay();
  }
}

void App::rest() {
  if (const MapletCut* closed = agent_->finish(Deadline::never())) {
    totals_.add(*closed);
    hand_out(closed);
  }
  log_info(config_.input.source + " is over: exchanging until stopped");
  notify_status("recording over");
  while (!stop_asked) {
    listen(kMeetings);
    if (monotonic_.now() - last_status_ >= 1s) publish_status(StatusRecord::State::kRunning);
    std::this_thread::sleep_for(50ms);
  }
}

int App::finish() {
  if (const MapletCut* closed = agent_->finish(Deadline::never())) {
    totals_.add(*closed);
    hand_out(closed);
  }
  publish_status(StatusRecord::State::kStopping);
  if (radio_ && output_) radio_->linger(config_.exchange.linger, [this] { listen(kMeetings); });
  if (publisher_ && publisher_->open() && !publisher_->flush(kFlushTime)) {
    log_warning("a subscriber did not take everything in time");
  }
  if (!output_) return kExitDone;
  totals_.unrelated = records_.refused();
  if (totals_.processed == 0) {
    log_error(config_.input.source + ": no usable frame; check the recording");
    return kExitFailure;
  }
  if (totals_.maplets == 0) {
    (void)write_report();
    log_error(
        fmt::format("{}: none of {} frames could be tracked, so there is no map; check depth "
                    "unit and intrinsics (mapletctl patches SOURCE --draw shows what is seen)",
                    config_.input.source, totals_.processed));
    return kExitFailure;
  }
  if (const auto written = output_->finish(*agent_); !written) {
    log_error(written.error());
    return kExitFailure;
  }
  // The picture tells figures of the report.
  return write_report() && draw() ? kExitDone : kExitFailure;
}

void App::publish_status(StatusRecord::State state) {
  last_status_ = monotonic_.now();
  if (!publisher_ && !console_) return;
  const StatusRecord record = status(state);
  if (console_) console_->note(record, agent_->skeleton(), !radio_ || radio_->settled());
  if (publisher_) (void)publisher_->publish(record);
}

StatusRecord App::status(StatusRecord::State state) const {
  StatusRecord status;
  status.agent = identity_.agent;
  status.epoch = identity_.epoch;
  status.state = state;
  status.tracking = tracking_;
  status.stamp = last_stamp_;
  status.uptime_ms = static_cast<std::uint64_t>((last_status_ - start_) / 1ms);
  const SourceCounters source = source_ ? source_->counters() : SourceCounters{};
  status.frames_read = source.read;
  status.frames_processed = totals_.processed;
  status.frames_dropped = source.dropped + totals_.dropped;
  status.frames_lost = totals_.lost;
  status.keyframes = totals_.keyframes;
  status.maplets = totals_.maplets;
  status.delta_poses = totals_.delta_poses;
  status.closures = totals_.closures;
  status.nodes = static_cast<std::uint32_t>(agent_->skeleton().node_count());
  status.factors = static_cast<std::uint32_t>(agent_->skeleton().factor_count());
  status.messages_dropped =
      publisher_ ? static_cast<std::uint32_t>(publisher_->counters().dropped) : 0;
  status.arena_bytes = arena_.used_bytes();
  status.rss_bytes = peak_rss_bytes();
  for (std::size_t i = 0; i < kStages; ++i)
    status.stages[i] = meters_.summary(static_cast<Stage>(i));
  return status;
}

bool App::draw() {
  // The headline is the source's, not the folder's: two runs give the same bytes.
  std::vector<std::string> arguments{"draw", output_->folder().string(), "--title",
                                     "Map of " + short_name(config_.input.source)};
  if (const auto& up = config_.body.up) {
    arguments.insert(arguments.end(),
                     {"--up", fmt::format("{},{},{}", (*up)[0], (*up)[1], (*up)[2])});
  }
  const std::string problem = call_mapletctl(arguments);
  if (!problem.empty()) log_error(problem);
  return problem.empty();
}

bool App::write_report() {
  const auto path = output_->folder() / "report.json";
  std::ofstream file{path};
  const auto radio = radio_ ? std::make_unique<RadioStatus>(radio_->status()) : nullptr;
  file << report_json(totals_, source_->counters(), meters_, arena_.used_bytes(), radio.get());
  file.close();
  if (!file) log_error(path.string() + ": cannot be written; make room and run again");
  return static_cast<bool>(file);
}

void App::say_detail() {
  const std::string_view detail = source_->detail();
  if (detail.empty() || detail == said_) return;
  said_.assign(detail);
  warnings_.say(said_);
}

void App::say_tracking(const Track& track) noexcept {
  const bool tracking = track.state == Track::State::kTracking;
  if (tracking == tracking_) return;
  tracking_ = tracking;
  if (tracking && totals_.lost == 0) return;  // the beginning
  std::array<char, 120> line;
  const auto end =
      tracking ? fmt::format_to_n(line.data(), line.size(), "tracking again at {:.3f} s",
                                  seconds(track.stamp))
               : fmt::format_to_n(line.data(), line.size(), "tracking lost ({}) at {:.3f} s",
                                  to_string(track.loss), seconds(track.stamp));
  warnings_.say({line.data(), std::min(line.size(), end.size)});
}

}  // namespace maplet::daemon
