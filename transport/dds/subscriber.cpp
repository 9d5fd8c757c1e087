// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/dds/subscriber.hpp"

#include <array>
#include <optional>

#include "core/limits.hpp"
#include "transport/dds/messages.hpp"

namespace maplet {

namespace {

constexpr std::array kUntaken = {8192, 64, 64};  ///< delta-poses, maplets, statuses

bool plausible(const MapletRecord& record) noexcept {
  return record.bytes.size() <= kMaxMapletBytes;
}

bool plausible(const StatusRecord& record) noexcept {
  return record.state <= StatusRecord::State::kHeld;
}

bool plausible(const DeltaPoseRecord& record) noexcept { return valid(record); }

}  // namespace

class DdsSubscriber::Impl {
 public:
  explicit Impl(DdsDomain domain) noexcept : domain_{std::move(domain)} {}

  [[nodiscard]] std::optional<DdsFailure> subscribe(const std::array<bool, 3>& wanted) {
    const dds_entity_t participant = domain_.participant();
    waitset_ = dds_create_waitset(participant);
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      if (!wanted[i]) continue;
      const dds_entity_t topic = make_topic(participant, static_cast<TopicKind>(i));
      readers_[i] = topic < 0 ? topic : make_reader(participant, topic, kUntaken[i]);
      const dds_entity_t condition =
          readers_[i] < 0 ? readers_[i] : dds_create_readcondition(readers_[i], DDS_ANY_STATE);
      if (condition < 0 || dds_waitset_attach(waitset_, condition, 0) != DDS_RETCODE_OK) {
        return DdsFailure{ErrorCode::kIo, "Cyclone DDS refuses a topic or reader: " +
                                              std::string{dds_strretcode(-condition)}};
      }
    }
    lend_bytes();
    return {};
  }

  [[nodiscard]] Expected<Message> next(Duration limit) noexcept {
    const MonotonicClock clock;
    const Instant end = clock.now() + limit;
    while (true) {
      if (auto message = take<DeltaPoseRecord>(readers_[0], delta_pose_)) return *message;
      if (auto message = take<MapletRecord>(readers_[1], maplet_)) return *message;
      if (auto message = take<StatusRecord>(readers_[2], status_)) return *message;
      const Duration left = end - clock.now();
      if (left <= Duration{0}) return fail(ErrorCode::kTimeout, "no message in time");
      if (dds_waitset_wait(waitset_, nullptr, 0, left.count()) < 0) {
        return fail(ErrorCode::kIo, "Cyclone DDS cannot wait for messages");
      }
    }
  }

  std::uint64_t rejected_ = 0;
  std::array<dds_entity_t, 3> readers_{};

 private:
  /// Cyclone copies a maplet's bytes into ours instead of allocating.
  void lend_bytes() noexcept {
    maplet_.data = {static_cast<std::uint32_t>(bytes_.size()), 0, bytes_.data(), false};
  }

  template <class Record, class Sample>
  std::optional<Message> take(dds_entity_t reader, Sample& sample) noexcept {
    if (reader <= 0) return {};
    void* place = &sample;
    dds_sample_info_t info;
    while (dds_take(reader, &place, &info, 1, 1) == 1) {
      if (!info.valid_data) continue;  // somebody left: what they said stays true
      const Record record = from_message(sample);
      if (plausible(record)) return record;
      ++rejected_;
    }
    return {};
  }

  DdsDomain domain_;
  dds_entity_t waitset_ = 0;
  maplet_msg_DeltaPose delta_pose_{};
  maplet_msg_Maplet maplet_{};
  maplet_msg_Status status_{};
  std::array<std::uint8_t, kMaxMapletBytes> bytes_{};
};

tl::expected<std::unique_ptr<DdsSubscriber>, DdsFailure> DdsSubscriber::open(
    const DdsConfig& config, Wanted wanted) {
  auto domain = DdsDomain::open(config, DdsDomain::Role::kWatcher);
  if (!domain) return tl::unexpected<DdsFailure>{domain.error()};
  auto impl = std::make_unique<Impl>(std::move(*domain));
  if (auto failure = impl->subscribe({wanted.delta_poses, wanted.maplets, wanted.statuses})) {
    return tl::unexpected<DdsFailure>{std::move(*failure)};
  }
  return std::unique_ptr<DdsSubscriber>{new DdsSubscriber{std::move(impl)}};
}

DdsSubscriber::DdsSubscriber(std::unique_ptr<Impl> impl) noexcept : impl_{std::move(impl)} {}
DdsSubscriber::~DdsSubscriber() = default;

Expected<DdsSubscriber::Message> DdsSubscriber::next(Duration limit) noexcept {
  return impl_->next(limit);
}

std::uint64_t DdsSubscriber::rejected() const noexcept { return impl_->rejected_; }

std::uint32_t DdsSubscriber::publishers() const noexcept {
  std::uint32_t count = 0;
  for (const dds_entity_t reader : impl_->readers_) {
    dds_subscription_matched_status_t matched{};
    if (reader > 0 && dds_get_subscription_matched_status(reader, &matched) == DDS_RETCODE_OK) {
      count += matched.current_count;
    }
  }
  return count;
}

}  // namespace maplet
