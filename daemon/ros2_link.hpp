// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <boost/lockfree/spsc_queue.hpp>
#include <optional>
#include <thread>

#include "daemon/map_view.hpp"
#include "daemon/pose_report.hpp"
#include "daemon/rate_limit.hpp"
#include "daemon/ros2_path.hpp"
#include "daemon/status_board.hpp"
#include "transport/dds/wake.hpp"
#include "transport/ros2/topics.hpp"

namespace maplet::daemon {

/// Tells ROS 2 nodes on this robot where it is, what it has seen and how it is.
///
/// Memory   queue, path and map of the configuration's sizes, at construction; diagnostics
/// allocate. Threads  report() and map().look() by the estimator's, without waiting or allocation;
/// a thread
///   of its own writes. A subscriber that does not read holds up that thread only.
class Ros2Link {
 public:
  static constexpr std::size_t kQueue = 64;

  Ros2Link(const Ros2Config& config, int agent, std::size_t max_maplets, const StatusBoard& board);
  ~Ros2Link();
  Ros2Link(const Ros2Link&) = delete;
  Ros2Link& operator=(const Ros2Link&) = delete;

  void start();
  void report(const PoseReport& report) noexcept;
  [[nodiscard]] MapView& map() noexcept { return map_; }
  [[nodiscard]] Ros2Topics& topics() noexcept { return topics_; }
  /// Nothing more is reported: writes what there is, the whole path and map, and waits a moment
  /// until everybody has it.
  void finish(Duration limit) noexcept;

  struct Status {
    Ros2Topics::Counters topics;
    std::uint64_t dropped = 0;  ///< reports that found the queue full
    MapView::Counts map;
  };
  [[nodiscard]] Status status() const noexcept;
  [[nodiscard]] static std::size_t bytes(const Ros2Config& config, std::size_t max_maplets);

 private:
  struct Limits {
    RateLimit odometry, path, map;
    RateLimit diagnostics{1.0};
  };
  void loop();
  void take_reports() noexcept;
  void tell_map() noexcept;
  void tell_path() noexcept;
  void diagnose_all();

  Ros2Config config_;
  int agent_;
  const StatusBoard& board_;
  Ros2Topics topics_;
  MapView map_;
  Ros2Path path_;
  Limits limits_;
  boost::lockfree::spsc_queue<PoseReport> queue_{kQueue};
  std::atomic<std::uint64_t> dropped_{0};
  Wake wake_;
  MonotonicClock clock_;

  // The thread's.
  bool ever_ = false;
  PoseReport newest_;  ///< of those that were tracked
  std::int64_t stamp_ns_ = 0;
  std::vector<RosQuad> quads_;  ///< of a message
  std::vector<RosMarker> markers_;
  std::uint32_t map_subscribers_ = 0;
  Se3 T_map_world_drawn_;
  bool map_left_ = false;  ///< not all that had changed was told
  std::uint64_t uptime_ms_ = 0;
  int silent_ = 0;

  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace maplet::daemon
