// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/ros2/odometry_inbox.hpp"

#include <dds/dds.h>
#include <fmt/format.h>
#include <ros2_msg.h>

#include <algorithm>
#include <atomic>
#include <boost/lockfree/spsc_queue.hpp>
#include <cstring>

#include "transport/ros2/names.hpp"
#include "transport/ros2/qos.hpp"

namespace maplet {

namespace {

constexpr int kUntaken = 10;
constexpr std::size_t kMostFrameName = 255;

using Message = nav_msgs_msg_dds__Odometry_;

OdometryReport report_of(const Message& m, std::uint64_t writer) noexcept {
  OdometryReport r;
  r.stamp_ns = std::int64_t{m.header.stamp.sec} * 1'000'000'000 + m.header.stamp.nanosec;
  r.writer = writer;
  const auto& p = m.pose.pose;
  r.t = {p.position.x, p.position.y, p.position.z};
  r.q = {p.orientation.x, p.orientation.y, p.orientation.z, p.orientation.w};
  r.covariance = Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>{m.pose.covariance};
  const auto& v = m.twist.twist;
  r.twist << v.linear.x, v.linear.y, v.linear.z, v.angular.x, v.angular.y, v.angular.z;
  r.twist_covariance =
      Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>{m.twist.covariance};
  return r;
}

}  // namespace

class OdometryInbox::Impl {
 public:
  explicit Impl(const Ros2Config& config)
      : topic_{dds_topic(config.name_space, config.external_odometry)},
        frame_{config.external_frame},
        base_{config.base_frame},
        queue_{kQueue} {
    if (!frame_.empty()) frame_known_ = true;
    frame_.reserve(kMostFrameName);
  }

  std::string join(dds_entity_t participant) {
    const dds_entity_t topic = dds_create_topic(participant, &nav_msgs_msg_dds__Odometry__desc,
                                                topic_.c_str(), nullptr, nullptr);
    dds_listener_t* listener = dds_create_listener(this);
    dds_lset_data_available(
        listener, [](dds_entity_t reader, void* self) { static_cast<Impl*>(self)->take(reader); });
    // Best effort: it matches publishers of either kind.
    const auto qos = ros_qos(false, kUntaken, false);
    dds_qset_ignorelocal(qos.get(), DDS_IGNORELOCAL_PARTICIPANT);
    const dds_entity_t reader =
        topic < 0 ? topic : dds_create_reader(participant, topic, qos.get(), listener);
    dds_delete_listener(listener);
    if (reader < 0) {
      return fmt::format("Cyclone DDS refuses to read {} ({}): check ros2.external_odometry",
                         topic_, dds_strretcode(-reader));
    }
    reader_ = reader;
    return {};
  }

  bool pop(OdometryReport& report) noexcept { return queue_.pop(report); }

  std::atomic<dds_entity_t> reader_{0};
  std::atomic<std::uint64_t> received_{0};
  std::atomic<std::uint64_t> wrong_frame_{0};
  std::atomic<std::uint64_t> flooded_{0};

 private:
  void take(dds_entity_t reader) noexcept {
    void* loan = nullptr;
    dds_sample_info_t info;
    while (dds_take(reader, &loan, &info, 1, 1) == 1) {
      if (info.valid_data) look(*static_cast<const Message*>(loan), info);
      (void)dds_return_loan(reader, &loan, 1);
      loan = nullptr;
    }
  }

  void look(const Message& message, const dds_sample_info_t& info) noexcept {
    ++received_;
    if (!has_time()) {
      ++flooded_;
    } else if (!is_wanted(message)) {
      ++wrong_frame_;
    } else if (!queue_.push(report_of(message, info.publication_handle))) {
      ++flooded_;
    }
  }

  bool has_time() noexcept {
    const Instant now = clock_.now();
    tokens_ =
        std::min(static_cast<double>(kMostAtOnce), tokens_ + kMostPerSecond * seconds(now - last_));
    last_ = now;
    if (tokens_ < 1.0) return false;
    tokens_ -= 1.0;
    return true;
  }

  bool is_wanted(const Message& m) noexcept {
    const char* frame = m.header.frame_id;
    if (frame == nullptr || m.child_frame_id == nullptr || base_ != m.child_frame_id) return false;
    if (frame_known_) return frame_ == frame;
    const std::size_t size = std::strlen(frame);
    if (size == 0 || size > kMostFrameName) return false;
    frame_.assign(frame, size);
    return frame_known_ = true;
  }

  std::string topic_;
  std::string frame_;
  bool frame_known_ = false;
  std::string base_;
  MonotonicClock clock_;
  Instant last_{};
  double tokens_ = kMostAtOnce;
  boost::lockfree::spsc_queue<OdometryReport> queue_;
};

OdometryInbox::OdometryInbox(const Ros2Config& config) : impl_{std::make_unique<Impl>(config)} {}
OdometryInbox::~OdometryInbox() = default;

std::string OdometryInbox::join(std::int32_t participant) { return impl_->join(participant); }

bool OdometryInbox::pop(OdometryReport& report) noexcept { return impl_->pop(report); }

OdometryInbox::Counters OdometryInbox::counters() const noexcept {
  Counters out{impl_->received_, impl_->wrong_frame_, impl_->flooded_, 0};
  dds_subscription_matched_status_t matched{};
  if (impl_->reader_ > 0 &&
      dds_get_subscription_matched_status(impl_->reader_, &matched) == DDS_RETCODE_OK) {
    out.publishers = matched.current_count;
  }
  return out;
}

}  // namespace maplet
