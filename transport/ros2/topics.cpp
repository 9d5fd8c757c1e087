// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/ros2/topics.hpp"

#include <dds/dds.h>
#include <fmt/format.h>
#include <ros2_msg.h>

#include <algorithm>
#include <atomic>
#include <vector>

#include "transport/ros2/messages.hpp"
#include "transport/ros2/names.hpp"
#include "transport/ros2/qos.hpp"

namespace maplet {

namespace {

enum Kind : std::size_t { kOdometry, kTf, kPath, kMap, kDiagnostics, kKinds };

constexpr std::size_t kPointsOfQuad = 6;  // two triangles
constexpr float kOpaque = 0.85F;

}  // namespace

class Ros2Topics::Impl {
 public:
  explicit Impl(const Ros2Config& config)
      : config_{config},
        path_(static_cast<std::size_t>(config.path_poses)),
        markers_(kMostMarkers),
        names_(kMostMarkers),
        points_(kMostQuads * kPointsOfQuad) {
    for (auto& name : names_) name.reserve(kNameBytes);
  }

  std::string join(dds_entity_t participant) {
    struct Wanted {
      Kind kind;
      const dds_topic_descriptor_t* type;
      std::string name;
      int history;
      bool keeps;  ///< for whoever comes later and asks for it
    };
    // As rclcpp's defaults and tf2_ros have them.
    const Wanted all[] = {
        {kOdometry, &nav_msgs_msg_dds__Odometry__desc,
         dds_topic(config_.name_space, config_.odometry_topic), 10, false},
        {kTf, &tf2_msgs_msg_dds__TFMessage__desc, "rt/tf", 100, false},
        {kPath, &nav_msgs_msg_dds__Path__desc, dds_topic(config_.name_space, "path"), 1, true},
        {kMap, &visualization_msgs_msg_dds__MarkerArray__desc,
         dds_topic(config_.name_space, "map_markers"), 10, true},
        {kDiagnostics, &diagnostic_msgs_msg_dds__DiagnosticArray__desc, "rt/diagnostics", 10,
         false}};
    for (const Wanted& w : all) {
      if (w.kind == kTf && !config_.tf) continue;
      const dds_entity_t topic =
          dds_create_topic(participant, w.type, w.name.c_str(), nullptr, nullptr);
      const auto qos = ros_qos(true, w.history, w.keeps);
      writers_[w.kind] =
          topic < 0 ? topic : dds_create_writer(participant, topic, qos.get(), nullptr);
      if (writers_[w.kind] < 0) {
        return fmt::format("Cyclone DDS refuses the topic {} ({}): check [ros2]", w.name,
                           dds_strretcode(-writers_[w.kind]));
      }
    }
    open_.store(true, std::memory_order_release);
    return {};
  }

  void write(Kind kind, const void* message) noexcept {
    if (!open_.load(std::memory_order_acquire) || writers_[kind] <= 0) return;
    const bool good = dds_write(writers_[kind], message) == DDS_RETCODE_OK;
    (good ? written_[kind] : failed_).fetch_add(1, std::memory_order_relaxed);
  }

  [[nodiscard]] dds_publication_matched_status_t matched(Kind kind) const noexcept {
    dds_publication_matched_status_t status{};
    if (open_.load(std::memory_order_acquire) && writers_[kind] > 0)
      (void)dds_get_publication_matched_status(writers_[kind], &status);
    return status;
  }

  bool flush(Duration limit) noexcept {
    if (!open_.load(std::memory_order_acquire)) return false;
    const MonotonicClock clock;
    const Instant end = clock.now() + limit;
    for (const dds_entity_t writer : writers_) {
      const Duration left = std::max(end - clock.now(), Duration{0});
      if (writer > 0 && dds_wait_for_acks(writer, left.count()) != DDS_RETCODE_OK) return false;
    }
    return true;
  }

  std_msgs_msg_dds__Header_ header(std::int64_t stamp_ns, const std::string& frame) const noexcept {
    return {to_ros_time(stamp_ns), const_cast<char*>(frame.c_str())};
  }

  void path(std::int64_t stamp_ns, std::span<const RosPathPose> poses) noexcept {
    const std::size_t count = std::min(poses.size(), path_.size());
    for (std::size_t i = 0; i < count; ++i) {
      path_[i] = {header(poses[i].stamp_ns, config_.map_frame), to_ros(poses[i].T_map_base)};
    }
    nav_msgs_msg_dds__Path_ message{};
    message.header = header(stamp_ns, config_.map_frame);
    lend(message.poses, path_.data(), count);
    write(kPath, &message);
  }

  void markers(std::int64_t stamp_ns, std::span<const RosMarker> markers) noexcept {
    std::size_t count = 0;
    std::size_t point = 0;
    for (const RosMarker& m : markers.first(std::min(markers.size(), kMostMarkers))) {
      if (point + m.quads.size() * kPointsOfQuad > points_.size()) break;
      auto& out = markers_[count];
      out = empty_marker();
      out.header = header(stamp_ns, config_.map_frame);
      auto& name = names_[count++];
      name.clear();
      fmt::format_to(std::back_inserter(name), "agent_{}_{:08x}", m.agent, m.epoch);
      out.ns = name.data();
      out.id = static_cast<std::int32_t>(m.id);
      out.type = kTriangles;
      out.action = m.gone ? kDelete : kAdd;
      out.pose = to_ros(m.T_map_maplet);
      out.scale = {1.0, 1.0, 1.0};
      out.color = {m.rgb[0], m.rgb[1], m.rgb[2], kOpaque};
      const std::size_t first = point;
      for (const RosQuad& quad : m.quads) {
        for (const int corner : {0, 1, 2, 0, 2, 3}) {
          const Eigen::Vector3f& p = quad.corners[static_cast<std::size_t>(corner)];
          points_[point++] = {p.x(), p.y(), p.z()};
        }
      }
      lend(out.points, points_.data() + first, point - first);
    }
    visualization_msgs_msg_dds__MarkerArray_ message{};
    lend(message.markers, markers_.data(), count);
    write(kMap, &message);
  }

  static constexpr std::size_t kNameBytes = 40;

  Ros2Config config_;
  std::atomic<bool> open_{false};
  std::array<dds_entity_t, kKinds> writers_{};
  std::array<std::atomic<std::uint64_t>, kKinds> written_{};
  std::atomic<std::uint64_t> failed_{0};

 private:
  static constexpr std::int32_t kTriangles = 11;
  static constexpr std::int32_t kAdd = 0;
  static constexpr std::int32_t kDelete = 2;

  static visualization_msgs_msg_dds__Marker_ empty_marker() noexcept {
    static char nothing[] = "";
    visualization_msgs_msg_dds__Marker_ m{};
    m.texture_resource = m.text = m.mesh_resource = nothing;
    m.texture.header.frame_id = m.texture.format = m.mesh_file.filename = nothing;
    return m;
  }

  std::vector<geometry_msgs_msg_dds__PoseStamped_> path_;
  std::vector<visualization_msgs_msg_dds__Marker_> markers_;
  std::vector<std::string> names_;
  std::vector<geometry_msgs_msg_dds__Point_> points_;
};

Ros2Topics::Ros2Topics(const Ros2Config& config) : impl_{std::make_unique<Impl>(config)} {}
Ros2Topics::~Ros2Topics() = default;

std::string Ros2Topics::join(std::int32_t participant) { return impl_->join(participant); }

bool Ros2Topics::open() const noexcept { return impl_->open_.load(std::memory_order_acquire); }

void Ros2Topics::write(const RosOdometry& odometry) noexcept {
  nav_msgs_msg_dds__Odometry_ message{};
  message.header = impl_->header(odometry.stamp_ns, impl_->config_.odom_frame);
  message.child_frame_id = const_cast<char*>(impl_->config_.base_frame.c_str());
  message.pose.pose = to_ros(odometry.T_odom_base);
  const Matrix6d fixed = to_fixed_axes(odometry.covariance, odometry.T_odom_base.q);
  std::copy_n(fixed.data(), 36, message.pose.covariance);  // symmetric
  message.twist.twist = to_ros(odometry.twist);
  std::copy_n(odometry.twist_covariance.data(), 36, message.twist.covariance);
  impl_->write(kOdometry, &message);
}

void Ros2Topics::write_tf(std::int64_t stamp_ns, const Se3& T_map_odom,
                          const Se3& T_odom_base) noexcept {
  const Ros2Config& config = impl_->config_;
  const auto name = [](const std::string& text) { return const_cast<char*>(text.c_str()); };
  geometry_msgs_msg_dds__TransformStamped_ both[] = {
      {impl_->header(stamp_ns, config.map_frame), name(config.odom_frame),
       to_ros_transform(T_map_odom)},
      {impl_->header(stamp_ns, config.odom_frame), name(config.base_frame),
       to_ros_transform(T_odom_base)}};
  tf2_msgs_msg_dds__TFMessage_ message{};
  lend(message.transforms, both, 2);
  impl_->write(kTf, &message);
}

void Ros2Topics::write_path(std::int64_t stamp_ns, std::span<const RosPathPose> poses) noexcept {
  impl_->path(stamp_ns, poses);
}

void Ros2Topics::write_markers(std::int64_t stamp_ns, std::span<const RosMarker> markers) noexcept {
  impl_->markers(stamp_ns, markers);
}

void Ros2Topics::write(std::int64_t stamp_ns, const RosDiagnosis& d) {
  static const std::string no_frame;
  const auto text = [](std::string_view s) { return const_cast<char*>(s.data()); };
  std::vector<diagnostic_msgs_msg_dds__KeyValue_> values;
  for (const auto& value : d.values) values.push_back({text(value.key), text(value.value)});
  diagnostic_msgs_msg_dds__DiagnosticStatus_ status{};
  status.level = static_cast<std::uint8_t>(d.level);
  status.name = text(d.name);
  status.message = text(d.message);
  status.hardware_id = text(d.hardware);
  lend(status.values, values.data(), values.size());
  diagnostic_msgs_msg_dds__DiagnosticArray_ message{};
  message.header = impl_->header(stamp_ns, no_frame);
  lend(message.status, &status, 1);
  impl_->write(kDiagnostics, &message);
}

std::uint32_t Ros2Topics::map_subscribers_so_far() noexcept {
  return impl_->matched(kMap).total_count;
}

bool Ros2Topics::path_wanted() noexcept { return impl_->matched(kPath).current_count > 0; }

bool Ros2Topics::flush(Duration limit) noexcept { return impl_->flush(limit); }

std::size_t Ros2Topics::bytes(const Ros2Config& config) {
  return static_cast<std::size_t>(config.path_poses) * sizeof(geometry_msgs_msg_dds__PoseStamped_) +
         kMostMarkers * (sizeof(visualization_msgs_msg_dds__Marker_) + Impl::kNameBytes +
                         sizeof(std::string)) +
         kMostQuads * kPointsOfQuad * sizeof(geometry_msgs_msg_dds__Point_);
}

Ros2Topics::Counters Ros2Topics::counters() const noexcept {
  const auto& w = impl_->written_;
  Counters out{w[kOdometry], w[kTf], w[kPath], w[kMap], w[kDiagnostics], impl_->failed_, 0};
  for (const Kind kind : {kOdometry, kTf, kPath, kMap, kDiagnostics})
    out.subscribers += impl_->matched(kind).current_count;
  return out;
}

}  // namespace maplet
