// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/app.hpp"

#include <fmt/format.h>

#include <array>
#include <chrono>
#include <thread>

#include "daemon/alloc_counter.hpp"
#include "daemon/log.hpp"
#include "daemon/mounting.hpp"
#include "daemon/progress.hpp"
#include "daemon/run_setup.hpp"
#include "daemon/service_notify.hpp"
#include "daemon/signals.hpp"
#include "daemon/thread_setup.hpp"

namespace maplet::daemon {

namespace {

using namespace std::chrono_literals;

/// What the stages are to know of the keys that are not theirs alone.
AgentConfig agent_config(const Config& config) {
  AgentConfig agent = config.agent;
  agent.planar = config.mission.motion == "planar";
  agent.mounting = mounting_of(config.body);
  return agent;
}

}  // namespace

App::App(const Options& options, const Config& config, StateDirectory state,
         std::optional<Flight> flight, const std::optional<SecuritySetup>& security)
    : options_{options},
      config_{config},
      state_{std::move(state)},
      replayed_{std::move(flight)},
      identity_{replayed_ ? replayed_->identity
                          : AgentIdentity{options.agent, epoch_of(options, config, state_)}},
      records_{identity_},
      agent_{
          arena_.make<Agent>("agent", agent_config(config), identity_, meters_, records_, arena_)},
      pace_{replayed_ ? replayed_->pace : pace_of(options, config)},
      live_{config,
            [this](const Config& changed) {
              if (radio_) radio_->adjust(changed);
            }},
      budget_{config.agent.frame.budget},
      given_{budget_} {
  if (replayed_) flight_.replay(std::move(replayed_->file), config.agent.limits.image());
  agent_->use_clock(flight_);
  if (pace_ != Pace::kFast && !replayed_)
    frames_ = std::make_unique<FramePool>(config.agent.limits.image().pixels());
  if (options.dds) radio_ = std::make_unique<RadioLink>(config, identity_, arena_, security);
  open_journal();
  const bool locked = arena_.seal(config.realtime.lock_memory);
  memory_ = std::make_unique<MemoryStatus>(arena_, locked);
}

App::~App() = default;

int App::run() {
  catch_signals(options_.out.empty());
  const bool swaps = config_.realtime.lock_memory && !memory_->locked();
  const auto may_swap = [&] {
    return !swaps || allowed("memory is not locked: grant LimitMEMLOCK (ulimit -l)");
  };
  // Of a finite run it is said behind what ends it at once.
  const bool at_once = options_.out.empty() || config_.realtime.required;
  if (at_once && !may_swap()) return kExitFailure;
  if (!open_recorder()) return kExitFailure;
  if (const std::string doubt = mounting_doubt(config_.body); !doubt.empty()) log_warning(doubt);
  start_ = flight_.now();
  resume_mission();
  if (journal_) journal_->start(radio_.get());
  if (const int exit_code = open(); exit_code != kExitDone) return exit_code;
  if (!at_once) (void)may_swap();
  const int priority = pace_ == Pace::kFast ? 0 : config_.realtime.estimator_priority;
  if (const auto problem = set_up_this_thread("mapletd", priority); !allowed(problem)) {
    return kExitFailure;
  }
  watch_this_thread();
  start_counting_allocations();
  notify_ready();
  const bool ended_well = loop();
  SourceCounters counted = source_counters();
  flight_.note_stop(counted);
  flight_.replayed_stop(counted);
  counted_ = counted;  // what the camera brings while the run ends is no part of it
  stop_counting_allocations();
  notify_stopping();
  if (flight_.damaged()) {
    log_warning(fmt::format("{}: damaged: its first {} processed frames are replayed",
                            config_.input.source, totals_.processed));
  }
  totals_.complete = ended_well && !flight_.flag(stop_asked()) && !stop_asked();
  if (stop_asked() && output_) {
    log_warning(fmt::format("stopped by a signal after {} frames; the folder has what was done",
                            totals_.processed));
  }
  const int finished = finish();
  if (flight_.recording()) flight_.flush();
  return ended_well ? finished : kExitFailure;
}

bool App::loop() {
  Progress progress{"mapping", source_ ? source_->length() : std::nullopt};
  while (!over()) {
    heart_.beat();
    if (gpio_ && gpio_->held()) stay_held();
    DepthFrame frame;
    switch (read(frame)) {
      case Read::kEnd:
        if (!finite()) rest();
        return true;
      case Read::kFailed:
        if (finite() || open_source(true) != kExitDone) return false;
        break;
      case Read::kNothing:  // for a second already
        listen(kMeetings);
        settle(Deadline{flight_, 1s});
        break;
      case Read::kFrame:
        if (pace_ != Pace::kFast && governor_.skips()) {
          ++totals_.dropped;
        } else {
          process(frame);
        }
        progress.show(source_counters().read);
    }
  }
  return true;
}

Expected<DepthFrame> App::ask_source(Duration patience) noexcept {
  if (capture_ != nullptr) return capture_->next(Deadline{machine_, patience});
  const StageScope scope{meters_, Stage::kSource, patience};
  const ThirdPartyScope theirs;  // decoding a recording allocates in its libraries
  const Heartbeat::Waiting waiting{heart_};
  return source_->next(Deadline{machine_, patience});
}

App::Read App::read(DepthFrame& frame) {
  constexpr Duration kPatience = std::chrono::seconds{1};
  constexpr int kMaxTimeouts = 5;  // a finite run does not wait for ever
  const auto next = flight_.frame([&]() -> Expected<DepthFrame> {
    auto came = ask_source(kPatience);
    if (came && neighbours_) {
      const auto when = capture_ != nullptr ? capture_->cost().came : std::nullopt;
      neighbours_->came(*came, when.value_or(machine_.now()));
    }
    return came;
  });
  if (!replayed_) say_detail();
  if (next) {
    if (capture_ != nullptr) {
      const ReadCost cost = capture_->cost();
      meters_.add(Stage::kSource, cost.wall, cost.cpu, kPatience);
      if (cost.came) latency_.add(machine_.now() - *cost.came);
    }
    frame = *next;
    timeouts_ = 0;
    return Read::kFrame;
  }
  switch (next.error().code) {
    case ErrorCode::kEnd:
      return Read::kEnd;
    case ErrorCode::kTimeout:
      if (++timeouts_ < kMaxTimeouts || !finite()) return Read::kNothing;
      log_error(config_.input.source + ": no frame for 5 s; check the device or the recording");
      return Read::kFailed;
    default: {
      const Line text = line("{}: {}", config_.input.source, next.error().what);
      finite() ? log_error(view(text)) : warnings_.say(view(text));
      return Read::kFailed;
    }
  }
}

void App::process(const DepthFrame& frame) {
  budget_ = flight_.budget(live_.frame_budget());
  if (const Duration given = governor_.budget(budget_); given != given_) {
    given_ = given;
    agent_->set_budget(given);
  }
  Step step;
  const Instant begin = flight_.now();
  {
    const StageScope scope{meters_, Stage::kFrame, budget_};
    step = agent_->step(frame, deadline(given_));
  }
  if (neighbours_) {
    const StageScope scope{meters_, Stage::kExchange, budget_};
    neighbours_->tell(step, *agent_);
  }
  if (pace_ != Pace::kFast) governor_.done(flight_.now() - begin, budget_);
  say_tracking(step.track);
  last_stamp_ = frame.stamp;
  totals_.add(step);
  free_ = free_axes_of(step.track);
  if (output_) {
    output_->frame(frame.index, step, digest_of(step, records_.pending(), agent_->skeleton()));
  }
  hand_out(step.closed);
  note_skeleton(false);
  listen(1);
  if (pace_ != Pace::kFast) settle(Deadline{flight_, budget_ - (flight_.now() - begin)});
  if (flight_.now() - last_status_ >= std::chrono::seconds{1}) {
    if (!finite() && !plane_doubted_) say_plane();
    publish_status(governor_.degraded() ? StatusRecord::State::kDegraded
                                        : StatusRecord::State::kRunning);
  }
}

void App::say_detail() {
  if (gray_) {
    if (const Line state = gray_->state(); state != gray_said_) {
      gray_said_ = state;
      warnings_.say(view(state));
    }
  }
  const std::string_view detail = source_->detail();
  if (detail.empty() || detail == view(said_)) return;
  said_.assign(detail.data(), std::min(detail.size(), kMaxLineBytes));
  warnings_.say(detail);
}

void App::set_tracking(bool tracking) noexcept {
  tracking_ = tracking;
  if (gpio_) gpio_->show_tracking(tracking);
}

void App::stay_held() {
  if (capture_ != nullptr) capture_->hold(true);
  set_tracking(false);
  publish_status(StatusRecord::State::kHeld);
  while (gpio_->held() && !stop_asked()) {
    heart_.beat();
    listen(kMeetings);
    if (flight_.now() - last_status_ >= 1s) publish_status(StatusRecord::State::kHeld);
    std::this_thread::sleep_for(20ms);
  }
  if (capture_ != nullptr) capture_->hold(false);
  publish_status(StatusRecord::State::kRunning);
}

void App::say_tracking(const Track& track) noexcept {
  if (track.leapt) {
    const Line leap = line("stamps leap from {:.3f} s to {:.3f} s: a gap", seconds(last_stamp_),
                           seconds(track.stamp));
    warnings_.say(view(leap));
  }
  const bool tracking = track.state == Track::State::kTracking;
  if (tracking == tracking_) return;
  set_tracking(tracking);
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
