// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/dds/radio.hpp"

#include <arpa/inet.h>
#include <dds/dds.h>
#include <fmt/format.h>
#include <ifaddrs.h>
#include <maplet_air.h>
#include <net/if.h>

#include <algorithm>
#include <array>
#include <optional>

#include "transport/dds/config.hpp"
#include "transport/dds/strangers.hpp"

namespace maplet {

namespace {

constexpr std::size_t kLanes = kTraffics;
constexpr std::array<const char*, kLanes> kWifiTopics{"maplet/air/delta_poses",
                                                      "maplet/air/closures", "maplet/air/ranges",
                                                      "maplet/air/control", "maplet/air/maplets"};
constexpr std::array<const char*, 2> kRadioTopics{"maplet/air/rt", "maplet/air/bulk"};
constexpr std::size_t kFrameBytes = 1200;
constexpr int kUntaken = 64;

/// Index and IPv4 address: what Cyclone has bound itself to.
struct InterfaceState {
  unsigned index = 0;
  std::uint32_t address = 0;
  bool up = false;

  friend bool operator==(const InterfaceState&, const InterfaceState&) = default;
};

InterfaceState state_of(const std::string& name) noexcept {
  InterfaceState state;
  state.index = if_nametoindex(name.c_str());
  ifaddrs* list = nullptr;
  if (state.index == 0 || getifaddrs(&list) != 0) return state;
  for (const ifaddrs* at = list; at != nullptr; at = at->ifa_next) {
    if (name != at->ifa_name || at->ifa_addr == nullptr) continue;
    state.up = state.up || (at->ifa_flags & IFF_UP) != 0;
    if (at->ifa_addr->sa_family != AF_INET || state.address != 0) continue;
    state.address = reinterpret_cast<const sockaddr_in*>(at->ifa_addr)->sin_addr.s_addr;
  }
  freeifaddrs(list);
  return state;
}

struct DeleteQos {
  void operator()(dds_qos_t* qos) const noexcept { dds_delete_qos(qos); }
};

}  // namespace

class DdsRadio::Impl {
 public:
  Impl(DdsDomain domain, const RadioConfig& config)
      : domain_{std::move(domain)},
        interface_{config.interface},
        bound_{state_of(interface_)},
        slow_{config.profile == "radio"},
        unicast_{!config.peer_list().empty()} {}

  [[nodiscard]] std::optional<DdsFailure> open_topics() {
    const dds_entity_t participant = domain_.participant();
    waitset_ = dds_create_waitset(participant);
    guard_ = dds_create_guardcondition(participant);
    (void)dds_waitset_attach(waitset_, guard_, 0);
    const std::unique_ptr<dds_qos_t, DeleteQos> qos{dds_create_qos()};
    dds_qset_reliability(qos.get(), DDS_RELIABILITY_BEST_EFFORT, 0);
    dds_qset_durability(qos.get(), DDS_DURABILITY_VOLATILE);
    dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, kUntaken);
    dds_qset_ignorelocal(qos.get(), DDS_IGNORELOCAL_PARTICIPANT);
    dds_qset_writer_data_lifecycle(qos.get(), false);
    for (std::size_t lane = 0; lane < lanes(); ++lane) {
      const dds_entity_t topic =
          dds_create_topic(participant, &maplet_air_Frame_desc, name(lane), nullptr, nullptr);
      writers_[lane] =
          topic < 0 ? topic : dds_create_writer(participant, topic, qos.get(), nullptr);
      readers_[lane] =
          topic < 0 ? topic : dds_create_reader(participant, topic, qos.get(), nullptr);
      const dds_entity_t condition = readers_[lane] < 0
                                         ? readers_[lane]
                                         : dds_create_readcondition(readers_[lane], DDS_ANY_STATE);
      if (writers_[lane] < 0 || condition < 0 ||
          dds_waitset_attach(waitset_, condition, 0) != DDS_RETCODE_OK) {
        return DdsFailure{ErrorCode::kIo, fmt::format("Cyclone DDS refuses topic {}: {}",
                                                      name(lane), dds_strretcode(-condition))};
      }
    }
    return {};
  }

  [[nodiscard]] bool write(Traffic traffic, std::span<const std::byte> datagram) noexcept {
    maplet_air_Frame frame{};
    frame.data._length = frame.data._maximum = static_cast<std::uint32_t>(datagram.size());
    frame.data._buffer = reinterpret_cast<std::uint8_t*>(const_cast<std::byte*>(datagram.data()));
    return dds_write(writers_[lane_of(traffic)], &frame) == DDS_RETCODE_OK;
  }

  // A participant whose user data changes announces itself anew.
  void announce() noexcept {
    ++announcement_;
    const std::unique_ptr<dds_qos_t, DeleteQos> qos{dds_create_qos()};
    dds_qset_userdata(qos.get(), &announcement_, sizeof announcement_);
    (void)dds_set_qos(domain_.participant(), qos.get());
  }

  int receive(Duration limit, FrameTaker& taker) noexcept {
    int count = take(taker);
    if (count > 0 || limit <= Duration{0}) return count;
    (void)dds_waitset_wait(waitset_, nullptr, 0, limit.count());
    bool interrupted = false;
    (void)dds_take_guardcondition(guard_, &interrupted);
    return take(taker);
  }

  void interrupt() noexcept { (void)dds_set_guardcondition(guard_, true); }

  [[nodiscard]] std::uint32_t listeners() const noexcept {
    dds_publication_matched_status_t matched{};
    if (dds_get_publication_matched_status(writers_[0], &matched) != DDS_RETCODE_OK) return 0;
    return matched.current_count;
  }
  void look_for_strangers() { strangers_.emplace(domain_.participant(), readers_[0]); }
  [[nodiscard]] std::uint64_t strangers(Instant now) noexcept {
    if (!strangers_) return 0;
    strangers_->look(now);
    return strangers_->count();
  }
  [[nodiscard]] bool unicast() const noexcept { return unicast_; }
  [[nodiscard]] bool interface_holds() const noexcept {
    return bound_.up && state_of(interface_) == bound_;
  }

 private:
  [[nodiscard]] std::size_t lanes() const noexcept { return slow_ ? 2 : kLanes; }
  [[nodiscard]] const char* name(std::size_t lane) const noexcept {
    return slow_ ? kRadioTopics[lane] : kWifiTopics[lane];
  }
  [[nodiscard]] std::size_t lane_of(Traffic traffic) const noexcept {
    if (!slow_) return static_cast<std::size_t>(traffic);
    return traffic == Traffic::kMaplets ? 1 : 0;
  }

  int take(FrameTaker& taker) noexcept {
    int count = 0;
    for (std::size_t lane = 0; lane < lanes(); ++lane) {
      maplet_air_Frame frame{};
      frame.data = {static_cast<std::uint32_t>(bytes_.size()), 0, bytes_.data(), false};
      void* place = &frame;
      dds_sample_info_t info;
      while (dds_take(readers_[lane], &place, &info, 1, 1) == 1) {
        if (!info.valid_data) continue;  // somebody left
        ++count;
        taker.take({reinterpret_cast<const std::byte*>(frame.data._buffer), frame.data._length});
      }
    }
    return count;
  }

  DdsDomain domain_;
  std::string interface_;
  InterfaceState bound_;
  bool slow_;
  bool unicast_;
  dds_entity_t waitset_ = 0;
  dds_entity_t guard_ = 0;
  std::optional<Strangers> strangers_;
  std::uint8_t announcement_ = 0;
  std::array<dds_entity_t, kLanes> writers_{};
  std::array<dds_entity_t, kLanes> readers_{};
  std::array<std::uint8_t, kFrameBytes> bytes_{};
};

tl::expected<std::unique_ptr<DdsRadio>, DdsFailure> DdsRadio::open(
    const RadioConfig& config, int domain, int agent, const DdsSecurityFiles* security) {
  const int wanted = config.interface == "lo" ? agent % kDaemonIndices : 0;
  auto opened = DdsDomain::open(
      {domain, config.interface, 0, kDaemonIndices, wanted, [&](int index, bool multicast) {
         return cyclone_radio_xml(config, index, multicast, security);
       }});
  if (!opened) return tl::unexpected<DdsFailure>{opened.error()};
  auto impl = std::make_unique<Impl>(std::move(*opened), config);
  if (auto failure = impl->open_topics()) return tl::unexpected<DdsFailure>{std::move(*failure)};
  if (security != nullptr) impl->look_for_strangers();
  return std::unique_ptr<DdsRadio>{new DdsRadio{std::move(impl)}};
}

DdsRadio::DdsRadio(std::unique_ptr<Impl> impl) noexcept : impl_{std::move(impl)} {}
DdsRadio::~DdsRadio() = default;

bool DdsRadio::write(Traffic lane, std::span<const std::byte> datagram) noexcept {
  return impl_->write(lane, datagram);
}
void DdsRadio::announce() noexcept { impl_->announce(); }
int DdsRadio::receive(Duration limit, FrameTaker& taker) noexcept {
  return impl_->receive(limit, taker);
}
void DdsRadio::interrupt() noexcept { impl_->interrupt(); }
std::uint32_t DdsRadio::listeners() const noexcept { return impl_->listeners(); }
std::uint32_t DdsRadio::copies() const noexcept {
  return impl_->unicast() ? std::max(1U, listeners()) : 1U;
}
std::uint64_t DdsRadio::strangers(Instant now) noexcept { return impl_->strangers(now); }
bool DdsRadio::interface_holds() const noexcept { return impl_->interface_holds(); }

}  // namespace maplet
