// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "core/geometry/se3.hpp"
#include "transport/dds/publisher.hpp"
#include "transport/ros2/ros2_config.hpp"

namespace maplet {

/// nav_msgs/Odometry. Frames as REP 103 has them; tangents [rho; theta] of the body.
struct RosOdometry {
  std::int64_t stamp_ns = 0;
  Se3 T_odom_base;
  Matrix6d covariance = Matrix6d::Zero();  ///< of T_odom_base
  Vector6d twist = Vector6d::Zero();       ///< m/s, rad/s, body
  Matrix6d twist_covariance = Matrix6d::Zero();
};

/// A pose of the path, map's frame.
struct RosPathPose {
  std::int64_t stamp_ns = 0;
  Se3 T_map_base;
};

/// A piece of a plane: corners anticlockwise as seen from where it was seen.
struct RosQuad {
  std::array<Eigen::Vector3f, 4> corners;
};

/// One maplet on the map.
struct RosMarker {
  std::uint16_t agent = 0;
  std::uint32_t epoch = 0;
  std::uint32_t id = 0;
  bool gone = false;  ///< it is to be deleted
  Se3 T_map_maplet;
  std::array<float, 3> rgb{};      ///< 0..1
  std::span<const RosQuad> quads;  ///< maplet's frame
};

struct RosDiagnosis {
  enum class Level : std::uint8_t { kOk, kWarn, kError };
  struct Value {
    std::string_view key;
    std::string value;
  };
  Level level = Level::kOk;
  std::string name;
  std::string message;
  std::string hardware;
  std::span<const Value> values;
};

/// The topics that ROS 2 nodes expect, in a domain that somebody else opened: types, names and QoS
/// as ROS 2 middleware has them (docs/ros2.md).
///
/// Memory   fixed at construction but for diagnostics; Cyclone's own for what is not acknowledged.
/// Threads  join() by any, once; everything else by one. A write may wait for a slow subscriber, up
///   to 100 ms.
class Ros2Topics final : public LocalGuest {
 public:
  static constexpr std::size_t kMostMarkers = 64;  ///< of a message
  static constexpr std::size_t kMostQuads = 640;   ///< the same; 92 KB

  explicit Ros2Topics(const Ros2Config& config);
  ~Ros2Topics() override;
  Ros2Topics(const Ros2Topics&) = delete;
  Ros2Topics& operator=(const Ros2Topics&) = delete;

  [[nodiscard]] std::string join(std::int32_t participant) override;
  [[nodiscard]] bool open() const noexcept;

  void write(const RosOdometry& odometry) noexcept;
  /// map to odom and odom to base at one moment.
  void write_tf(std::int64_t stamp_ns, const Se3& T_map_odom, const Se3& T_odom_base) noexcept;
  /// @param poses  config.path_poses at most; the rest is left out
  void write_path(std::int64_t stamp_ns, std::span<const RosPathPose> poses) noexcept;
  /// @param markers  with kMostMarkers and kMostQuads at most; the rest is left out
  void write_markers(std::int64_t stamp_ns, std::span<const RosMarker> markers) noexcept;
  void write(std::int64_t stamp_ns, const RosDiagnosis& diagnosis);

  /// How many there have ever been: when it grows, somebody has just come.
  [[nodiscard]] std::uint32_t map_subscribers_so_far() noexcept;
  [[nodiscard]] bool path_wanted() noexcept;
  /// Everybody has everything. @return false when `limit` passed before
  bool flush(Duration limit) noexcept;

  [[nodiscard]] static std::size_t bytes(const Ros2Config& config);

  struct Counters {
    std::uint64_t odometry = 0, tf = 0, path = 0, map = 0, diagnostics = 0;  ///< messages
    std::uint64_t failed = 0;  ///< refused by Cyclone, or not taken in time
    std::uint32_t subscribers = 0;
  };
  [[nodiscard]] Counters counters() const noexcept;  ///< any thread

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace maplet
