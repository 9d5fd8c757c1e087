// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/dds/publisher.hpp"

#include <pthread.h>

#include <array>
#include <atomic>
#include <boost/lockfree/spsc_queue.hpp>
#include <optional>
#include <thread>

#include "core/limits.hpp"
#include "transport/dds/arrivals.hpp"
#include "transport/dds/messages.hpp"
#include "transport/dds/quiet.hpp"
#include "transport/dds/range_topic.hpp"
#include "transport/dds/wake.hpp"

namespace maplet {

namespace {

using std::chrono::milliseconds;

constexpr std::size_t kDeltaPoseQueue = 1024;
constexpr std::size_t kMapletQueueBytes = std::size_t{1} << 19;
constexpr std::size_t kStatusQueue = 8;
constexpr Duration kRetry = std::chrono::seconds{1};
/// Discovery on one machine takes tens of milliseconds (docs/dds.md): who showed up this recently
/// may still be about to subscribe.
constexpr Duration kSettle = milliseconds{300};

/// What stands before a maplet's bytes in its queue.
struct MapletHead {
  MapletRecord record;  ///< bytes.data() is meaningless here
};
static_assert(kMapletQueueBytes >= 4 * (sizeof(MapletHead) + kMaxMapletBytes));

}  // namespace

class DdsPublisher::Impl {
 public:
  Impl(const DdsConfig& config, int agent, LocalGuest* guest)
      : config_{config},
        agent_{agent},
        guest_{guest},
        ranges_{static_cast<std::uint16_t>(agent)},
        delta_poses_{kDeltaPoseQueue},
        maplets_{kMapletQueueBytes},
        statuses_{kStatusQueue} {}

  ~Impl() {
    stop_ = true;
    wake_.post();
    if (thread_.joinable()) thread_.join();
  }

  [[nodiscard]] std::optional<DdsFailure> open_now() {
    auto domain = DdsDomain::open(config_, DdsDomain::Role::kDaemon, agent_);
    if (!domain) return domain.error();
    const dds_entity_t participant = domain->participant();
    const std::array histories{config_.delta_pose_history, config_.maplet_history, 1};
    for (std::size_t i = 0; i < writers_.size(); ++i) {
      const dds_entity_t topic = make_topic(participant, static_cast<TopicKind>(i));
      writers_[i] = topic < 0 ? topic : make_writer(participant, topic, histories[i]);
      if (writers_[i] < 0) {
        return DdsFailure{ErrorCode::kIo, "Cyclone DDS refuses a topic or writer: " +
                                              std::string{dds_strretcode(-writers_[i])}};
      }
    }
    if (!ranges_.open(participant)) {
      return DdsFailure{ErrorCode::kIo, "Cyclone DDS refuses to read " + std::string{kRangeTopic}};
    }
    if (guest_ != nullptr) {
      if (std::string problem = guest_->join(participant); !problem.empty())
        return DdsFailure{ErrorCode::kIo, std::move(problem)};
    }
    arrivals_.emplace(participant, writers_[0]);
    domain_.emplace(std::move(*domain));
    open_.store(true, std::memory_order_release);
    return {};
  }

  void run() {
    const SignalsBlocked quiet;  // the thread inherits the mask
    thread_ = std::thread{[this] { loop(); }};
    pthread_setname_np(thread_.native_handle(), "dds-out");
  }

  template <class Queue, class Record>
  bool push(Queue& queue, const Record& record) noexcept {
    return accept(queue.push(record));
  }

  bool push_maplet(const MapletRecord& record) noexcept {
    MapletHead head{record};
    const std::size_t bytes = record.bytes.size();
    if (bytes > kMaxMapletBytes || maplets_.write_available() < sizeof head + bytes) {
      return accept(false);
    }
    maplets_.push(reinterpret_cast<const std::byte*>(&head), sizeof head);
    maplets_.push(record.bytes.data(), bytes);
    return accept(true);
  }

  bool flush(Duration limit) noexcept {
    const MonotonicClock clock;
    const Instant end = clock.now() + limit;
    const auto left = [&] { return std::max(end - clock.now(), Duration{0}); };
    while (true) {
      if (left() <= Duration{0}) return false;
      const bool written = open_.load(std::memory_order_acquire) && handled_ == accepted_;
      if (written && acknowledged(left()) && arrivals_->quiet_for(clock.now()) >= kSettle) {
        return true;
      }
      std::this_thread::sleep_for(milliseconds{2});
    }
  }

  DdsConfig config_;
  int agent_;
  LocalGuest* guest_;
  RangeInbox ranges_;  ///< ends after the domain
  boost::lockfree::spsc_queue<DeltaPoseRecord> delta_poses_;
  boost::lockfree::spsc_queue<std::byte> maplets_;
  boost::lockfree::spsc_queue<StatusRecord> statuses_;
  std::atomic<bool> open_{false};
  std::array<dds_entity_t, 3> writers_{};
  std::atomic<std::uint64_t> accepted_{0};
  std::atomic<std::uint64_t> handled_{0};
  std::atomic<std::uint64_t> dropped_{0};
  std::atomic<std::uint64_t> failed_{0};
  std::array<std::atomic<std::uint64_t>, 3> written_{};

 private:
  bool accept(bool fitted) noexcept {
    (fitted ? accepted_ : dropped_).fetch_add(1, std::memory_order_relaxed);
    if (fitted) wake_.post();
    return fitted;
  }

  bool acknowledged(Duration limit) noexcept {
    for (const dds_entity_t writer : writers_) {
      if (dds_wait_for_acks(writer, limit.count()) != DDS_RETCODE_OK) return false;
    }
    return true;
  }

  void loop() noexcept {
    while (!stop_) {
      if (!open_ && open_now()) {
        wake_.wait(kRetry);
        continue;
      }
      drain();
      wake_.wait(kRetry);
    }
    if (open_) drain();
  }

  void drain() noexcept {
    DeltaPoseRecord delta;
    while (delta_poses_.pop(delta)) {
      const auto message = to_message(delta);
      write(TopicKind::kDeltaPose, &message);
    }
    MapletHead head;
    while (maplets_.read_available() >= sizeof head) {
      maplets_.pop(reinterpret_cast<std::byte*>(&head), sizeof head);
      const std::size_t bytes = head.record.bytes.size();
      // The head is pushed before its bytes: they are on their way.
      for (std::size_t got = 0; got < bytes;) {
        got += maplets_.pop(maplet_bytes_.data() + got, bytes - got);
      }
      head.record.bytes = {maplet_bytes_.data(), bytes};
      const auto message = to_message(head.record);
      write(TopicKind::kMaplet, &message);
    }
    StatusRecord status;
    while (statuses_.pop(status)) {
      const auto message = to_message(status);
      write(TopicKind::kStatus, &message);
    }
  }

  void write(TopicKind kind, const void* message) noexcept {
    const auto index = static_cast<std::size_t>(kind);
    const bool good = dds_write(writers_[index], message) == DDS_RETCODE_OK;
    (good ? written_[index] : failed_).fetch_add(1, std::memory_order_relaxed);
    handled_.fetch_add(1, std::memory_order_release);
  }

  Wake wake_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
  std::array<std::byte, kMaxMapletBytes> maplet_bytes_{};
  std::optional<DdsDomain> domain_;
  std::optional<Arrivals> arrivals_;  ///< ends before the domain
};

tl::expected<std::unique_ptr<DdsPublisher>, DdsFailure> DdsPublisher::start(const DdsConfig& config,
                                                                            int agent,
                                                                            Missing missing,
                                                                            LocalGuest* guest) {
  auto impl = std::make_unique<Impl>(config, agent, guest);
  if (auto failure = impl->open_now()) {
    if (missing == Missing::kFail || failure->code != ErrorCode::kDevice) {
      return tl::unexpected<DdsFailure>{std::move(*failure)};
    }
  }
  impl->run();
  return std::unique_ptr<DdsPublisher>{new DdsPublisher{std::move(impl)}};
}

DdsPublisher::DdsPublisher(std::unique_ptr<Impl> impl) noexcept : impl_{std::move(impl)} {}
DdsPublisher::~DdsPublisher() = default;

bool DdsPublisher::publish(const DeltaPoseRecord& record) noexcept {
  return impl_->push(impl_->delta_poses_, record);
}

bool DdsPublisher::publish(const MapletRecord& record) noexcept {
  return impl_->push_maplet(record);
}

bool DdsPublisher::publish(const StatusRecord& record) noexcept {
  return impl_->push(impl_->statuses_, record);
}

bool DdsPublisher::measured(RangeReport& report) noexcept { return impl_->ranges_.pop(report); }

bool DdsPublisher::flush(Duration limit) noexcept { return impl_->flush(limit); }

bool DdsPublisher::open() const noexcept { return impl_->open_; }

std::uint32_t DdsPublisher::subscribers() const noexcept {
  if (!open()) return 0;
  dds_publication_matched_status_t matched{};
  if (dds_get_publication_matched_status(impl_->writers_[0], &matched) != DDS_RETCODE_OK) return 0;
  return matched.current_count;
}

DdsPublisher::Counters DdsPublisher::counters() const noexcept {
  const auto& written = impl_->written_;
  return {written[0], written[1], written[2], impl_->dropped_, impl_->failed_};
}

}  // namespace maplet
