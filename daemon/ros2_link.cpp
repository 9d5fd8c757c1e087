// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/ros2_link.hpp"

#include <chrono>
#include <utility>

#include "daemon/ros2_diagnosis.hpp"
#include "daemon/thread_setup.hpp"

namespace maplet::daemon {

namespace {

constexpr Duration kTick = std::chrono::milliseconds{50};  // between two messages of the map
constexpr int kSilent = 3;                                 // s

/// One colour an agent, lighter and darker from maplet to maplet.
std::array<float, 3> colour_of(const MapletKey& key) noexcept {
  constexpr std::array<std::array<float, 3>, 6> kAgents{{{0.26F, 0.53F, 0.80F},
                                                         {0.87F, 0.50F, 0.20F},
                                                         {0.35F, 0.65F, 0.35F},
                                                         {0.70F, 0.35F, 0.60F},
                                                         {0.75F, 0.68F, 0.25F},
                                                         {0.45F, 0.45F, 0.50F}}};
  std::array<float, 3> rgb = kAgents[(key.agent + kAgents.size() - 1) % kAgents.size()];
  const float shade = 0.8F + 0.1F * static_cast<float>(key.id % 4);
  for (float& c : rgb) c *= shade;
  return rgb;
}

bool same(const Se3& a, const Se3& b) noexcept {
  const Se3 off = a.inverse() * b;
  return off.t.norm() < 1e-6 && off.angle() < 1e-6;
}

}  // namespace

Ros2Link::Ros2Link(const Ros2Config& config, int agent, std::size_t max_maplets,
                   const StatusBoard& board)
    : config_{config},
      agent_{agent},
      board_{board},
      topics_{config},
      map_{max_maplets, static_cast<std::size_t>(config.map_quads)},
      path_{static_cast<std::size_t>(config.path_poses)},
      limits_{RateLimit{config.odometry_hz}, RateLimit{config.path_hz}, RateLimit{config.map_hz}} {
  quads_.reserve(Ros2Topics::kMostQuads);
  markers_.reserve(Ros2Topics::kMostMarkers);
}

Ros2Link::~Ros2Link() { finish(Duration{0}); }

void Ros2Link::start() {
  thread_ = start_thread("ros2-out", [this] { loop(); });
}

void Ros2Link::report(const PoseReport& report) noexcept {
  if (!queue_.push(report)) dropped_.fetch_add(1, std::memory_order_relaxed);
  wake_.post();
}

void Ros2Link::loop() {
  while (!stop_) {
    wake_.wait(kTick);
    take_reports();
    const Instant now = clock_.now();
    if (limits_.diagnostics.pass(now)) diagnose_all();
    if (!ever_) continue;
    if (limits_.path.pass(now) && topics_.path_wanted()) tell_path();
    if (map_left_ || limits_.map.pass(now)) tell_map();
  }
}

void Ros2Link::take_reports() noexcept {
  PoseReport report;
  while (queue_.pop(report)) {
    stamp_ns_ = report.stamp_ns;
    if (!report.tracking) continue;  // where it is is not known: nobody is told anything
    newest_ = report;
    ever_ = true;
    path_.add(report);
    if (!limits_.odometry.pass(clock_.now())) continue;
    const OutsidePose& p = report.enu_flu;
    RosOdometry odometry{report.stamp_ns, p.T_odom_base, p.covariance, p.twist, p.twist_covariance};
    if (!report.moves) {
      constexpr double kUnknown = 1e6;
      odometry.twist_covariance = kUnknown * Matrix6d::Identity();
    }
    topics_.write(odometry);
    if (config_.tf) topics_.write_tf(report.stamp_ns, p.T_map_odom, p.T_odom_base);
  }
}

void Ros2Link::tell_path() noexcept { topics_.write_path(newest_.stamp_ns, path_.poses(map_)); }

// One message at a time: what has changed, as much as it holds.
void Ros2Link::tell_map() noexcept {
  if (!topics_.open() || config_.map_hz == 0.0) return;
  const std::uint32_t subscribers = topics_.map_subscribers_so_far();
  const bool came = std::exchange(map_subscribers_, subscribers) < subscribers;
  if (came || !same(T_map_world_drawn_, newest_.T_map_world)) map_.change_all();
  T_map_world_drawn_ = newest_.T_map_world;
  quads_.clear();
  markers_.clear();
  map_left_ = !map_.take_changed([&](const MapView::Item& item, std::span<const RosQuad> pieces) {
    if (markers_.size() == markers_.capacity() ||
        quads_.size() + pieces.size() > quads_.capacity()) {
      return false;
    }
    const std::size_t first = quads_.size();
    if (!item.gone) quads_.insert(quads_.end(), pieces.begin(), pieces.end());
    const MapletKey& key = item.placed.key;
    markers_.push_back({key.agent, key.epoch, key.id, item.gone,
                        newest_.T_map_world * item.placed.T_world_maplet, colour_of(key),
                        std::span{quads_}.subspan(first)});
    return true;
  });
  if (!markers_.empty()) topics_.write_markers(newest_.stamp_ns, markers_);
}

void Ros2Link::diagnose_all() {
  const StatusBoard::Notice notice = board_.read();
  const bool same_as_before =
      std::exchange(uptime_ms_, notice.status.uptime_ms) == notice.status.uptime_ms;
  silent_ = same_as_before ? silent_ + 1 : 0;
  Diagnosis diagnosis = diagnose(notice, agent_, silent_ > kSilent);
  diagnosis.told.values = diagnosis.values;
  topics_.write(stamp_ns_, diagnosis.told);
}

void Ros2Link::finish(Duration limit) noexcept {
  if (!thread_.joinable()) return;
  stop_ = true;
  wake_.post();
  thread_.join();
  if (limit == Duration{0}) return;
  take_reports();
  if (ever_) {
    tell_path();
    constexpr int kMostMessages = 256;
    for (int i = 0; i < kMostMessages; ++i) {
      tell_map();
      if (!map_left_ || !topics_.flush(limit)) break;
    }
  }
  (void)topics_.flush(limit);
}

Ros2Link::Status Ros2Link::status() const noexcept {
  return {topics_.counters(), dropped_, map_.counts()};
}

std::size_t Ros2Link::bytes(const Ros2Config& config, std::size_t max_maplets) {
  return sizeof(Ros2Link) + kQueue * sizeof(PoseReport) + Ros2Topics::bytes(config) +
         MapView::bytes(max_maplets, static_cast<std::size_t>(config.map_quads)) +
         Ros2Path::bytes(static_cast<std::size_t>(config.path_poses)) +
         Ros2Topics::kMostQuads * sizeof(RosQuad) + Ros2Topics::kMostMarkers * sizeof(RosMarker);
}

}  // namespace maplet::daemon
