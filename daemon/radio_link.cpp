// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/radio_link.hpp"

#include <algorithm>
#include <utility>

#include "daemon/log.hpp"
#include "daemon/thread_setup.hpp"
#include "transport/dds/wire_meter.hpp"

namespace maplet::daemon {

namespace {

using namespace std::chrono_literals;

constexpr std::size_t kRecords = 1024;  // what does not fit is asked for again
constexpr std::size_t kMapletBytes = std::size_t{1} << 17;
constexpr Duration kNap = 25ms;    // how long an own record may wait for the thread
constexpr Duration kLook = 500ms;  // at the interface and for the status
constexpr Duration kRetry = 1s;
constexpr Duration kUnheard = 20s;  // nobody was heard for: perhaps somebody else is there
constexpr Duration kLonely = 100s;
constexpr Duration kDiscovery = 25s;
constexpr Duration kArrival = 60s;  // announcements are lost, too: a new one says so more often

struct MapletHead {
  MapletKey key;
  float saliency = 0.0F;
  std::uint32_t bytes = 0;
};

template <class Queue>
bool push_maplet(Queue& queue, const MapletHead& head, std::span<const std::byte> bytes) noexcept {
  if (queue.write_available() < sizeof head + bytes.size()) return false;
  queue.push(reinterpret_cast<const std::byte*>(&head), sizeof head);
  queue.push(bytes.data(), bytes.size());
  return true;
}

template <class Queue>
std::optional<MapletHead> pop_maplet(Queue& queue, std::span<std::byte> bytes) noexcept {
  MapletHead head;
  if (queue.read_available() < sizeof head) return {};
  queue.pop(reinterpret_cast<std::byte*>(&head), sizeof head);
  while (queue.read_available() < head.bytes) std::this_thread::yield();  // its second push
  queue.pop(bytes.data(), head.bytes);
  return head;
}

/// 1 = every maplet, 0 = those near ours, -1 = none.
int wish_of(const Config& config) noexcept {
  if (config.exchange.maplets == "all") return 1;
  return config.exchange.maplets == "near" ? 0 : -1;
}

/// A sealed datagram is not larger on the air than a plain one may be.
LinkProfile profile_of(const Config& config) noexcept {
  LinkProfile profile = config.radio.link_profile();
  if (config.security.on()) profile.datagram_bytes -= kSealBytes;
  return profile;
}

SyncConfig exchange_of(const Config& config) noexcept {
  SyncConfig exchange = config.exchange;
  exchange.expected_maplet_bytes = config.agent.limits.expected_maplet_bytes();
  return exchange;
}

}  // namespace

void RadioLink::adjust(const Config& config) noexcept {
  wish_all_ = wish_of(config);
  bytes_per_s_ = config.radio.budget_bytes_per_s;
}

RadioLink::RadioLink(const Config& config, AgentIdentity identity, Arena& arena,
                     const std::optional<SecuritySetup>& security)
    : config_{config.radio},
      domain_{config.radio.domain(config.dds.domain)},
      identity_{identity},
      wish_all_{wish_of(config)},
      bytes_per_s_{config.radio.budget_bytes_per_s},
      node_{arena.make<ExchangeNode>("exchange/node", exchange_of(config), profile_of(config),
                                     static_cast<std::size_t>(config.agent.maplet.max_bytes),
                                     Life{identity.agent, identity.epoch},
                                     static_cast<RecordTaker&>(*this), arena)},
      security_{config.security.on()
                    ? arena.make<LinkSecurity>("security/link", config, security, arena)
                    : nullptr},
      dds_security_{config.security.in_dds() ? std::optional{DdsSecurityFiles{config.security.keys}}
                                             : std::nullopt},
      overhead_{config.security.in_dds() ? kSecuredWireOverheadBytes : kWireOverheadBytes},
      most_bytes_{config.radio.link_profile().datagram_bytes},
      budget_{static_cast<double>(config.radio.budget_bytes_per_s), most_bytes_ + overhead_,
              MonotonicClock{}.now()},
      delta_poses_out_{kRecords},
      ranges_out_{256},
      maplets_out_{kMapletBytes},
      delta_poses_in_{kRecords},
      ranges_in_{256},
      maplets_in_{kMapletBytes} {}

std::size_t RadioLink::queue_bytes() noexcept {
  return 2 * (kRecords * sizeof(DeltaPoseRecord) + 256 * sizeof(RangeRecord) + kMapletBytes);
}

RadioLink::~RadioLink() {
  stop_ = true;
  if (thread_.joinable()) thread_.join();
}

std::optional<DdsFailure> RadioLink::start(bool wait) {
  WireMeter::watch_domain(domain_);
  if (security_) {
    std::string problem = security_->problem();
    if (!problem.empty() && !wait) return DdsFailure{ErrorCode::kBadInput, std::move(problem)};
  }
  auto opened = open_link();
  if (opened) {
    radio_ = std::move(*opened);
    open_ = true;
    opened_at_ = clock_.now();
  } else if (!wait || opened.error().code != ErrorCode::kDevice) {
    return opened.error();
  } else {
    log_warning("waiting for the link: " + opened.error().what);
  }
  thread_ = start_thread("radio", [this] { loop(); });
  return {};
}

bool RadioLink::publish(const DeltaPoseRecord& record) noexcept {
  return delta_poses_out_.push(record);
}

bool RadioLink::publish(const RangeRecord& record) noexcept { return ranges_out_.push(record); }

bool RadioLink::publish(const MapletKey& key, std::span<const std::byte> bytes,
                        float saliency) noexcept {
  return push_maplet(maplets_out_, {key, saliency, static_cast<std::uint32_t>(bytes.size())},
                     bytes);
}

std::size_t RadioLink::heard_maplet(MapletKey& key, std::span<std::byte> bytes) noexcept {
  const auto head = pop_maplet(maplets_in_, bytes);
  if (!head) return 0;
  key = head->key;
  return head->bytes;
}

void RadioLink::set_near(std::span<const MapletKey> keys,
                         std::span<const std::uint16_t> related) noexcept {
  const std::unique_lock lock{mutex_, std::try_to_lock};
  if (!lock) return;  // the next time
  near_count_ = std::min(keys.size(), near_.size());
  std::copy_n(keys.begin(), near_count_, near_.begin());
  related_.assign(related.begin(),
                  related.begin() + std::min<std::ptrdiff_t>(std::ssize(related), 32));
}

bool RadioLink::take(const DeltaPoseRecord& record) noexcept {
  return delta_poses_in_.push(record);
}

bool RadioLink::take(const RangeRecord& record) noexcept { return ranges_in_.push(record); }

bool RadioLink::take(const MapletKey& key, std::span<const std::byte> bytes) noexcept {
  return push_maplet(maplets_in_, {key, 0.0F, static_cast<std::uint32_t>(bytes.size())}, bytes);
}

float RadioLink::wish(const MapletKey& key, float saliency) noexcept {
  if (wish_all_ < 0) return -1.0F;
  const std::unique_lock lock{mutex_, std::try_to_lock};
  for (std::size_t i = 0; lock && i < near_count_; ++i) {
    if (near_[i] == key) return 1.0F + saliency;
  }
  if (wish_all_ > 0) return saliency;
  const bool somewhere = lock && std::ranges::find(related_, key.agent) == related_.end();
  return somewhere ? saliency : -1.0F;
}

void RadioLink::take(std::span<const std::byte> datagram) noexcept {
  const Instant now = clock_.now();
  if (!security_) {
    if (is_secured(datagram)) {
      ++sealed_heard_;
    } else {
      node_->receive(datagram, now);
    }
    return;
  }
  const auto inside = security_->open(datagram, now);
  if (security_->let_in()) node_->wake(now);
  if (!inside.empty()) node_->receive(inside, now);
}

tl::expected<std::unique_ptr<DdsRadio>, DdsFailure> RadioLink::open_link() const {
  return DdsRadio::open(config_, domain_, identity_.agent,
                        dds_security_ ? &*dds_security_ : nullptr);
}

void RadioLink::loop() noexcept {
  while (!stop_) {
    Instant now = clock_.now();
    if (now - looked_at_ > kLook) look_after_link(now);
    if (radio_) {
      const Instant due = security_ ? std::min(security_->due(), node_->due()) : node_->due();
      (void)radio_->receive(std::clamp<Duration>(due - now, 2ms, kNap), *this);
    } else {
      std::this_thread::sleep_for(kNap);
    }
    now = clock_.now();
    take_own(now);
    if (radio_) send(now);
    if (now - noted_at_ > kLook / 4) {
      if (security_) security_->look(now);
      note_status(now);
      warn_once();
    }
  }
  radio_.reset();
}

void RadioLink::look_after_link(Instant now) noexcept {
  looked_at_ = now;
  if (radio_) announce(now);
  if (radio_) strangers_ = radio_->strangers(now);
  if (radio_ && !radio_->interface_holds()) {
    log_warning("dds.interface '" + config_.interface + "' is gone or has changed: waiting for it");
    radio_.reset();
    open_ = false;
    listeners_ = 0;
    strangers_before_ += std::exchange(strangers_, 0);
  }
  if (radio_ || now < retry_at_) return;
  retry_at_ = now + kRetry;
  auto opened = open_link();
  if (!opened) {
    if (!warned_.open && opened.error().code != ErrorCode::kDevice) {
      log_warning(opened.error().what + "; tried again every few seconds");
      warned_.open = true;
    }
    return;
  }
  warned_.open = false;
  radio_ = std::move(*opened);
  open_ = true;
  opened_at_ = now;
  log_info("the link on '" + config_.interface + "' is open");
  node_->wake(now);
}

// DDS says every two minutes that we are here; who has news, or hears nobody, does not wait so
// long.
void RadioLink::announce(Instant now) noexcept {
  const bool slow = config_.profile == "radio";
  Duration every = Duration::max();
  if (node_->fresh(now) || node_->lonely(now, kLonely)) every = 40s;
  if (node_->fresh(now) && node_->lonely(now, kUnheard) && !slow) every = 10s;
  if (now - opened_at_ < kArrival) every = slow ? 20s : 6s;
  if (node_->silent() || now - announced_at_ < every) return;
  if (announced_at_ != Instant{}) radio_->announce();
  announced_at_ = now;
}

void RadioLink::take_own(Instant now) noexcept {
  const std::int64_t clock_ns = record_clock_ns_;
  if (clock_ns != record_clock_set_) {
    record_clock_set_ = clock_ns;
    node_->set_record_clock(Stamp{clock_ns}, now, clock_rate_);
  }
  if (silent_ != node_->silent()) {
    node_->set_silent(silent_);
    if (!silent_) node_->wake(now);
  }
  DeltaPoseRecord delta;
  while (delta_poses_out_.pop(delta)) (void)node_->put(delta, now);
  RangeRecord range;
  while (ranges_out_.pop(range)) (void)node_->put(range, now);
  while (const auto head = pop_maplet(maplets_out_, maplet_)) {
    (void)node_->put(head->key, std::span{maplet_}.first(head->bytes), head->saliency, now);
  }
}

void RadioLink::charge_others(Instant now) noexcept {
  if (!WireMeter::available) return;
  const std::uint64_t bytes = WireMeter::bytes;
  if (bytes == metered_) return;
  budget_.charge_others(static_cast<std::size_t>(bytes - metered_), now);
  wire_bytes_ += bytes - metered_;
  dds_bytes_ += bytes - metered_;
  metered_ = bytes;
}

void RadioLink::write(Traffic lane, std::span<const std::byte> frame, std::size_t copies,
                      Instant now) noexcept {
  charge_others(now);
  (void)radio_->write(lane, frame);
  std::uint64_t bytes = (frame.size() + overhead_) * copies;
  if (WireMeter::available) {
    bytes = WireMeter::bytes - metered_;
    metered_ += bytes;
  }
  budget_.charge(static_cast<std::size_t>(bytes), now);
  wire_bytes_ += bytes;
  lane_bytes_[static_cast<std::size_t>(lane)] += bytes;
}

void RadioLink::send(Instant now) noexcept {
  charge_others(now);
  const auto rate = static_cast<std::uint64_t>(bytes_per_s_.load());
  budget_.set_rate(static_cast<double>(rate));
  budget_.set_apart(node_->somebody_away(now));
  // Robots find each other first; from then on not even DDS's repetitions go beyond the budget.
  WireMeter::most_in_a_window =
      now - opened_at_ < kDiscovery ? 0 : rate * (WireMeter::kWindow / 1s);
  const std::uint32_t listeners = radio_->listeners();
  if (listeners > listeners_) node_->wake(now);
  listeners_ = listeners;
  if (listeners == 0) return;  // nobody would hear it
  const std::size_t copies = radio_->copies();
  const std::size_t most = (most_bytes_ + overhead_) * copies;
  while (budget_.allows(most, now, false)) {
    if (security_ && !silent_) {
      if (const auto frame = security_->next(now); !frame.empty()) {
        write(Traffic::kControl, frame, copies, now);
        continue;
      }
    }
    const ExchangeNode::Outgoing out = node_->next(now, budget_.allows(most, now));
    if (out.bytes.empty()) return;
    const auto frame = security_ ? security_->seal(out.bytes) : out.bytes;
    if (frame.empty()) return;  // without keys of today
    write(out.lane, frame, copies, now);
  }
}

}  // namespace maplet::daemon
