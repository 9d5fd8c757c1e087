// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/dds/domain.hpp"

#include <arpa/inet.h>
#include <dds/dds.h>
#include <fmt/format.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <sys/socket.h>
#include <unistd.h>

#include <mutex>
#include <utility>

#include "transport/dds/quiet.hpp"

namespace maplet {

namespace {

/// Cyclone says why it failed only to its log: keeps the last complaint.
class LogTap {
 public:
  LogTap() noexcept : lock_{mutex()} {
    last().clear();
    dds_set_log_sink(&LogTap::take, nullptr);
  }
  ~LogTap() { dds_set_log_sink(&LogTap::ignore, nullptr); }
  LogTap(const LogTap&) = delete;
  LogTap& operator=(const LogTap&) = delete;

  [[nodiscard]] const std::string& complaint() const { return last(); }

 private:
  static std::mutex& mutex() {
    static std::mutex one;
    return one;
  }
  static std::string& last() {
    static std::string one;
    return one;
  }
  static void take(void*, const dds_log_data_t* data) {
    if ((data->priority & (DDS_LC_ERROR | DDS_LC_FATAL)) == 0 && !last().empty()) return;
    last().assign(data->message, data->size);
    while (!last().empty() && last().back() == '\n') last().pop_back();
  }
  static void ignore(void*, const dds_log_data_t*) {}

  std::lock_guard<std::mutex> lock_;
};

/// Whether a participant index's unicast port is free: a fixed index that is taken is an error to
/// Cyclone, and we would rather take the next.
bool port_is_free(int domain, int index) {
  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return true;
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(7400 + 250 * domain + 10 + 2 * index));
  const bool free = bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  close(fd);
  return free;
}

tl::unexpected<DdsFailure> failed(ErrorCode code, std::string what) {
  return tl::unexpected<DdsFailure>{DdsFailure{code, std::move(what)}};
}

/// @return domain and participant, negative when Cyclone refused
std::pair<dds_entity_t, dds_entity_t> create(int domain_id, const std::string& xml) {
  const SignalsBlocked quiet;  // Cyclone's threads inherit the mask
  const auto id = static_cast<dds_domainid_t>(domain_id);
  const dds_entity_t domain = dds_create_domain(id, xml.c_str());
  if (domain < 0) return {domain, domain};
  const dds_entity_t participant = dds_create_participant(id, nullptr, nullptr);
  if (participant < 0) dds_delete(domain);
  return {domain, participant};
}

}  // namespace

std::optional<std::string> interface_problem(const std::string& interface) {
  ifaddrs* list = nullptr;
  if (if_nametoindex(interface.c_str()) == 0 || getifaddrs(&list) != 0) {
    return fmt::format("dds.interface '{}' does not exist: name one that `ip link` lists, or lo",
                       interface);
  }
  bool up = false;
  bool has_address = false;
  for (const ifaddrs* at = list; at != nullptr; at = at->ifa_next) {
    if (interface != at->ifa_name) continue;
    up = up || (at->ifa_flags & IFF_UP) != 0;
    has_address = has_address || (at->ifa_addr != nullptr && at->ifa_addr->sa_family == AF_INET);
  }
  freeifaddrs(list);
  if (!up) {
    return fmt::format("dds.interface '{0}' is down: `ip link set {0} up`, or use lo", interface);
  }
  if (!has_address) {
    return fmt::format("dds.interface '{}' has no IPv4 address: give it one, or use lo", interface);
  }
  return {};
}

tl::expected<DdsDomain, DdsFailure> DdsDomain::open(const DdsConfig& config, Role role, int agent) {
  const bool daemon = role == Role::kDaemon;
  const int count = daemon ? kDaemonIndices : kWatcherIndices;
  return open({config.domain, config.interface, daemon ? 0 : kDaemonIndices, count,
               daemon ? agent % count : 0,
               [&](int index, bool multicast) { return cyclone_xml(config, index, multicast); }});
}

tl::expected<DdsDomain, DdsFailure> DdsDomain::open(const Choice& choice) {
  if (auto problem = interface_problem(choice.interface)) {
    return failed(ErrorCode::kDevice, std::move(*problem));
  }
  const LogTap log;
  int refused = 0;
  for (int i = 0; i < choice.count && refused < 3; ++i) {
    const int index = choice.first + (choice.wanted + i) % choice.count;
    if (!port_is_free(choice.domain, index)) continue;
    // Where an interface cannot do multicast, unicast to the known indices is enough.
    for (const bool multicast : {true, false}) {
      const auto [domain, participant] = create(choice.domain, choice.xml(index, multicast));
      if (participant >= 0) return DdsDomain{domain, participant, index};
    }
    ++refused;  // perhaps somebody took the port in between
  }
  if (refused == 0) {
    return failed(ErrorCode::kCapacity,
                  fmt::format("all {} DDS participant indices of domain {} are taken on this host: "
                              "stop some, or choose another dds.domain",
                              choice.count, choice.domain));
  }
  return failed(ErrorCode::kIo,
                fmt::format("Cyclone DDS refuses domain {} on '{}' ({}): check dds.* and dds.peers",
                            choice.domain, choice.interface, log.complaint()));
}

DdsDomain::DdsDomain(DdsDomain&& other) noexcept
    : domain_{std::exchange(other.domain_, 0)},
      participant_{std::exchange(other.participant_, 0)},
      index_{other.index_} {}

DdsDomain::~DdsDomain() {
  if (participant_ > 0) dds_delete(participant_);
  if (domain_ > 0) dds_delete(domain_);
}

}  // namespace maplet
