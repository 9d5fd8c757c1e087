// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/dds/range_topic.hpp"

#include <dds/dds.h>
#include <maplet_msg.h>

#include <algorithm>
#include <atomic>
#include <boost/lockfree/spsc_queue.hpp>
#include <string>
#include <thread>

namespace maplet {

namespace {

constexpr int kUntaken = 64;
constexpr std::size_t kQueue = 256;

struct DeleteQos {
  void operator()(dds_qos_t* qos) const noexcept { dds_delete_qos(qos); }
};

std::unique_ptr<dds_qos_t, DeleteQos> range_qos() noexcept {
  std::unique_ptr<dds_qos_t, DeleteQos> qos{dds_create_qos()};
  dds_qset_reliability(qos.get(), DDS_RELIABILITY_RELIABLE, DDS_MSECS(100));
  dds_qset_durability(qos.get(), DDS_DURABILITY_VOLATILE);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, kUntaken);
  return qos;
}

dds_entity_t range_topic(dds_entity_t participant) noexcept {
  return dds_create_topic(participant, &maplet_msg_Range_desc, kRangeTopic.data(), nullptr,
                          nullptr);
}

RangeReport from_message(const maplet_msg_Range& m) noexcept {
  RangeReport r{m.agent, m.other, Stamp{m.stamp_ns}, m.range_m, m.sigma_m, {}, m.bearing_sigma_rad};
  std::copy_n(m.bearing, 3, r.bearing.begin());
  return r;
}

maplet_msg_Range to_message(const RangeReport& r) noexcept {
  maplet_msg_Range m{};
  m.stamp_ns = r.stamp.count();
  m.agent = r.agent;
  m.other = r.other;
  m.range_m = r.range_m;
  m.sigma_m = r.sigma_m;
  std::copy_n(r.bearing.begin(), 3, m.bearing);
  m.bearing_sigma_rad = r.bearing_sigma_rad;
  return m;
}

}  // namespace

class RangeInbox::Impl {
 public:
  explicit Impl(std::uint16_t agent) : agent_{agent}, queue_{kQueue} {}

  bool open(dds_entity_t participant) {
    const dds_entity_t topic = range_topic(participant);
    if (topic < 0) return false;
    dds_listener_t* listener = dds_create_listener(this);
    dds_lset_data_available(
        listener, [](dds_entity_t reader, void* self) { static_cast<Impl*>(self)->take(reader); });
    const auto qos = range_qos();
    const dds_entity_t reader = dds_create_reader(participant, topic, qos.get(), listener);
    dds_delete_listener(listener);
    return reader >= 0;
  }
  bool pop(RangeReport& report) noexcept { return queue_.pop(report); }

  std::atomic<std::uint64_t> rejected_{0};

 private:
  void take(dds_entity_t reader) noexcept {
    maplet_msg_Range message;
    void* place = &message;
    dds_sample_info_t info;
    while (dds_take(reader, &place, &info, 1, 1) == 1) {
      if (!info.valid_data) continue;
      const RangeReport report = from_message(message);
      if (report.agent != agent_) continue;  // another robot's on the same host
      if (!valid(report) || !queue_.push(report)) ++rejected_;
    }
  }

  std::uint16_t agent_;
  boost::lockfree::spsc_queue<RangeReport> queue_;
};

RangeInbox::RangeInbox(std::uint16_t agent) : impl_{std::make_unique<Impl>(agent)} {}
RangeInbox::~RangeInbox() = default;
bool RangeInbox::open(std::int32_t participant) { return impl_->open(participant); }
bool RangeInbox::pop(RangeReport& report) noexcept { return impl_->pop(report); }
std::uint64_t RangeInbox::rejected() const noexcept { return impl_->rejected_; }

class RangeWriter::Impl {
 public:
  explicit Impl(DdsDomain domain) noexcept : domain_{std::move(domain)} {
    const dds_entity_t topic = range_topic(domain_.participant());
    const auto qos = range_qos();
    writer_ =
        topic < 0 ? topic : dds_create_writer(domain_.participant(), topic, qos.get(), nullptr);
  }

  DdsDomain domain_;
  dds_entity_t writer_ = 0;
};

tl::expected<std::unique_ptr<RangeWriter>, DdsFailure> RangeWriter::open(const DdsConfig& config) {
  auto domain = DdsDomain::open(config, DdsDomain::Role::kWatcher);
  if (!domain) return tl::unexpected<DdsFailure>{domain.error()};
  auto impl = std::make_unique<Impl>(std::move(*domain));
  if (impl->writer_ < 0) {
    return tl::unexpected<DdsFailure>{DdsFailure{
        ErrorCode::kIo,
        "Cyclone DDS refuses a topic or writer: " + std::string{dds_strretcode(-impl->writer_)}}};
  }
  return std::unique_ptr<RangeWriter>{new RangeWriter{std::move(impl)}};
}

RangeWriter::RangeWriter(std::unique_ptr<Impl> impl) noexcept : impl_{std::move(impl)} {}
RangeWriter::~RangeWriter() = default;

bool RangeWriter::wait_for_reader(Duration limit) noexcept {
  const MonotonicClock clock;
  for (const Instant end = clock.now() + limit; clock.now() < end;) {
    dds_publication_matched_status_t matched{};
    if (dds_get_publication_matched_status(impl_->writer_, &matched) == DDS_RETCODE_OK &&
        matched.current_count > 0) {
      return true;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds{20});
  }
  return false;
}

bool RangeWriter::write(const RangeReport& report, Duration limit) noexcept {
  const maplet_msg_Range message = to_message(report);
  return dds_write(impl_->writer_, &message) == DDS_RETCODE_OK &&
         dds_wait_for_acks(impl_->writer_, limit.count()) == DDS_RETCODE_OK;
}

}  // namespace maplet
