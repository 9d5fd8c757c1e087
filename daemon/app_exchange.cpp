// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Between the estimator and everybody else: what is found out goes out, what others found out comes
// in, and when both are still, the skeleton settles.
#include <algorithm>
#include <array>
#include <chrono>
#include <thread>

#include "daemon/app.hpp"
#include "daemon/log.hpp"
#include "daemon/signals.hpp"
#include "transport/exchange/json.hpp"

namespace maplet::daemon {

namespace {

using namespace std::chrono_literals;

MapletRecord record_of(const MapletCut& closed) {
  return {closed.maplet.key, closed.maplet.stamp,
          static_cast<std::uint16_t>(closed.maplet.planes.size()),
          static_cast<std::uint16_t>(closed.maplet.keyframes.size()), closed.bytes};
}

}  // namespace

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
  const StageScope scope{meters_, Stage::kExchange, budget_};
  if (closed != nullptr || !records_.pending().empty() || !records_.pending_ranges().empty())
    last_news_ = flight_.now();
  if (closed != nullptr) {
    if (output_) output_->maplet(*closed);
    publish(record_of(*closed));
    if (journal_) {
      if (pace_ == Pace::kFast) journal_->wait_for_room();
      journal_->put(closed->maplet.key, closed->bytes, agent_->saliency());
    } else if (radio_) {
      (void)radio_->publish(closed->maplet.key, closed->bytes, agent_->saliency());
    }
  }
  for (const DeltaPoseRecord& record : records_.pending()) {
    totals_.add(record.kind);
    if (output_) {
      const JsonLine line = to_json(record);
      output_->delta_pose({line.data(), line.size()});
    }
    publish(record);
    put_on_air(record);
  }
  for (const RangeRecord& record : records_.pending_ranges()) {
    ++totals_.ranges;
    put_on_air(record);
  }
  records_.clear_pending();
}

void App::listen(int meetings) {
  if (console_) console_->attend(*agent_, Deadline::never());
  flight_.repeat_operators(*agent_);
  if (neighbours_) neighbours_->look(*agent_);
  if (!linked() && !agent_->encounters().busy()) return;
  const StageScope scope{meters_, Stage::kExchange, budget_};
  const Deadline until = deadline(budget_);
  if (linked()) hear_others(until);
  for (int i = 0; i < meetings; ++i) {
    const bool more = agent_->meet(until);
    hand_out(nullptr);
    if (!more) break;
    if (radio_) radio_->stay();
  }
}

void App::hear_others(Deadline until) {
  constexpr int kAtOnce = 16;
  if (radio_) radio_->set_record_clock(last_stamp_);
  if (radio_ && gpio_) radio_->set_clock_rate(gpio_->clock_rate());
  DeltaPoseRecord record;
  for (int i = 0; i < kAtOnce && flight_.heard(record, [&] { return radio_->heard(record); });
       ++i) {
    (void)agent_->hear(restore(record), until);
    if (journal_) journal_->put(record);
    last_news_ = flight_.now();
  }
  RangeRecord range;
  for (int i = 0; i < kAtOnce && flight_.heard(range, [&] { return radio_->heard(range); }); ++i) {
    (void)agent_->hear(restore(range), until);
    if (journal_) journal_->put(range);
    last_news_ = flight_.now();
  }
  take_ranges();
  say_what_is_near();
  agent_->place_range(until);
  if (!records_.pending_ranges().empty()) hand_out(nullptr);
  MapletKey key;
  if (const std::size_t bytes = flight_.heard_maplet(
          key, maplet_bytes_, [&] { return radio_->heard_maplet(key, maplet_bytes_); })) {
    (void)agent_->hear(key, std::span{maplet_bytes_}.first(bytes));
  }
}

void App::say_what_is_near() {
  constexpr Duration kEvery = 2s;
  if (flight_.now() - last_near_ < kEvery) return;
  last_near_ = flight_.now();
  std::array<MapletKey, 32> near;
  const std::size_t count = agent_->expected_near(near);
  const Skeleton& skeleton = agent_->skeleton();
  const MapletKey self{identity_.agent, identity_.epoch, 0};
  StaticVector<std::uint16_t, 32> related;
  for (int i = 0; i < skeleton.node_count() && skeleton.pose(self) != nullptr; ++i) {
    const Skeleton::NodeView node = skeleton.node(i);
    if (node.key.agent == self.agent || full(related) || !(node.gauge == skeleton.gauge(self)))
      continue;
    if (std::ranges::find(related, node.key.agent) == related.end())
      related.push_back(node.key.agent);
  }
  if (radio_) radio_->set_near(std::span{near}.first(count), {related.data(), related.size()});
}

void App::take_ranges() {
  RangeReport report;
  while (flight_.heard(report, [&] { return publisher_ && publisher_->measured(report); })) {
    RangeToAgent range;
    range.other = report.other;
    range.stamp = report.stamp;
    range.measured = {report.range_m,
                      report.sigma_m,
                      {report.bearing[0], report.bearing[1], report.bearing[2]},
                      report.bearing_sigma_rad};
    const auto offset = radio_ ? radio_->clock_offset(report.other) : std::nullopt;
    range.clock_offset = flight_.offset(offset).value_or(Duration{});
    agent_->measured(range);
  }
}

void App::settle(Deadline spare) {
  constexpr Duration kQuiet = 1s;
  if (agent_->settled() || flight_.now() - last_news_ < kQuiet) return;
  if (agent_->encounters().busy()) return;
  if (linked() && flight_.flag(radio_ && radio_->hears_more())) return;
  const Heartbeat::Waiting long_work{heart_};
  (void)agent_->settle(spare);
}

void App::rest() {
  if (const MapletCut* closed = agent_->finish(Deadline::never())) {
    totals_.add(*closed);
    hand_out(closed);
  }
  log_info(config_.input.source + " is over: exchanging until stopped");
  while (!over()) {
    heart_.beat();
    listen(kMeetings);
    settle(Deadline::never());
    if (flight_.now() - last_status_ >= 1s) publish_status(StatusRecord::State::kRunning);
    if (!replayed_) std::this_thread::sleep_for(50ms);
    flight_.keep_going();
  }
}

}  // namespace maplet::daemon
