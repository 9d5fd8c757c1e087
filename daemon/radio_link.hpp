// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <boost/lockfree/spsc_queue.hpp>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "core/agent/agent.hpp"
#include "core/base/arena.hpp"
#include "daemon/config.hpp"
#include "daemon/link_security.hpp"
#include "transport/dds/radio.hpp"
#include "transport/sync/byte_budget.hpp"
#include "transport/sync/node.hpp"

namespace maplet::daemon {

/// What `mapletctl status` and `peers` show of the link.
struct RadioStatus {
  static constexpr std::size_t kMaxPeers = 64;
  bool open = false;
  bool silent = false;
  bool settled = false;  ///< everybody heard holds the same records
  std::uint32_t listeners = 0;
  std::uint64_t records = 0;
  std::uint64_t records_digest = 0;
  std::array<std::uint32_t, kStreams> own{};  ///< records of ours, by stream
  std::uint64_t missing = 0;
  std::uint64_t wire_bytes = 0;                       ///< since the start, IP and DDS included
  std::uint64_t held_back = 0;                        ///< datagrams beyond the budget, not sent
  std::uint64_t dds_bytes = 0;                        ///< of these, what is not ours
  std::uint64_t window_bytes = 0;                     ///< of the last ten seconds
  std::array<std::uint64_t, kTraffics> lane_bytes{};  ///< of our datagrams, by what they lead with
  std::uint32_t conflicts = 0;
  int conflicting_agent = -1;
  std::uint64_t lives_refused = 0;  ///< times that there was no room for another agent's life
  NodeCounters counters;
  MapletTrade::Counters maplets;
  SecurityStatus security;
  struct PeerStatus {
    Peer peer;
    bool in_sync = false;
    std::array<std::uint32_t, kStreams> held_of{};  ///< of that life, without a gap
    double silent_s = 0.0;
  };
  std::size_t peer_count = 0;
  std::array<PeerStatus, kMaxPeers> peers;
};

/// A thread that keeps one end of the exchange: the node's logic, the byte budget, the DDS link.
///
/// Memory   the node from the arena, queues fixed at construction (about 1 MB).
/// Threads  publish() from one thread, the journal's where there is one, and heard() from the
///   estimator's, without waiting and without
///   allocation; status(), set_silent() and adjust() from any.
class RadioLink final : private RecordTaker, private FrameTaker {
 public:
  /// @param security  the keys, where security is on; without them nothing can be opened
  RadioLink(const Config& config, AgentIdentity identity, Arena& arena,
            const std::optional<SecuritySetup>& security = {});
  ~RadioLink() override;
  RadioLink(const RadioLink&) = delete;
  RadioLink& operator=(const RadioLink&) = delete;
  /// What the queues take of the heap, at construction.
  [[nodiscard]] static std::size_t queue_bytes() noexcept;

  /// Opens the link and starts the thread.
  /// @param wait  an interface that is missing is no error: keep trying
  [[nodiscard]] std::optional<DdsFailure> start(bool wait);

  // What was known before the start: ExchangeNode::restore(). Before start().
  template <class Record>
  void restore(const Record& record) noexcept {
    node_->restore(record);
  }
  void restore(const MapletKey& key, std::span<const std::byte> bytes, float saliency) noexcept {
    node_->restore(key, bytes, saliency);
  }
  void restored(Stream stream, std::uint32_t end) noexcept { node_->restored(stream, end); }

  /// @return false when the queue was full
  bool publish(const DeltaPoseRecord& record) noexcept;
  bool publish(const RangeRecord& record) noexcept;
  bool publish(const MapletKey& key, std::span<const std::byte> bytes, float saliency) noexcept;
  /// The record clock: of the newest frame.
  void set_record_clock(Stamp stamp) noexcept { record_clock_ns_ = stamp.count(); }
  /// True seconds in a second of our clock: how the record clock goes on while no frames come.
  void set_clock_rate(double rate) noexcept { clock_rate_ = rate; }

  /// The next record of others. @return false when there is none
  bool heard(DeltaPoseRecord& record) noexcept { return delta_poses_in_.pop(record); }
  bool heard(RangeRecord& record) noexcept { return ranges_in_.pop(record); }
  /// @param bytes  at least kMaxMapletBytes
  /// @return the size of the next maplet of others, 0 when there is none
  std::size_t heard_maplet(MapletKey& key, std::span<std::byte> bytes) noexcept;
  /// An agent's record clock minus ours, once known. Without waiting: now and then it is not told.
  [[nodiscard]] std::optional<Duration> clock_offset(std::uint16_t agent) const noexcept;
  /// Maplets nearest to ours, by the skeleton, are asked for first. Without waiting.
  /// @param related  agents that the skeleton relates to us: of others every maplet may be near
  void set_near(std::span<const MapletKey> keys, std::span<const std::uint16_t> related) noexcept;

  void set_silent(bool silent) noexcept { silent_ = silent; }
  /// Takes what may change while it runs: the byte budget, which maplets to ask for.
  void adjust(const Config& config) noexcept;
  /// Something is still being worked at: linger().
  void stay() noexcept { touched_ = true; }
  [[nodiscard]] bool open() const noexcept { return open_; }
  /// Records of others wait to be heard here.
  [[nodiscard]] bool hears_more() const noexcept {
    return delta_poses_in_.read_available() > 0 || ranges_in_.read_available() > 0;
  }
  /// Everybody heard holds the same records, and all are taken in here.
  [[nodiscard]] bool settled() const noexcept { return settled_ && !hears_more(); }
  /// Of the records held, a moment ago.
  [[nodiscard]] std::uint64_t records_digest() const noexcept { return records_digest_; }
  [[nodiscard]] RadioStatus status() const;
  /// nullptr: security is off. Threads any.
  [[nodiscard]] LinkSecurity* security() noexcept { return security_.get(); }
  /// Waits until all that others hold is here and the other way round: nobody heard, or nothing
  /// changed any more. Calls `meanwhile` many times a second.
  template <class Meanwhile>
  void linger(Duration limit, Meanwhile&& meanwhile) {
    const MonotonicClock clock;
    touched_ = true;
    at_rest_ = false;
    for (const Instant end = clock.now() + limit; clock.now() < end && !at_rest();) {
      meanwhile();
      std::this_thread::sleep_for(std::chrono::milliseconds{20});
    }
    meanwhile();
  }

 private:
  bool take(const DeltaPoseRecord& record) noexcept override;
  bool take(const RangeRecord& record) noexcept override;
  bool take(const MapletKey& key, std::span<const std::byte> bytes) noexcept override;
  float wish(const MapletKey& key, float saliency) noexcept override;
  void take(std::span<const std::byte> datagram) noexcept override;

  void loop() noexcept;
  void look_after_link(Instant now) noexcept;
  void announce(Instant now) noexcept;
  void take_own(Instant now) noexcept;
  void send(Instant now) noexcept;
  void write(Traffic lane, std::span<const std::byte> frame, std::size_t copies,
             Instant now) noexcept;
  void charge_others(Instant now) noexcept;
  [[nodiscard]] tl::expected<std::unique_ptr<DdsRadio>, DdsFailure> open_link() const;
  void note_status(Instant now) noexcept;
  void warn_once() noexcept;
  [[nodiscard]] bool at_rest() const noexcept { return at_rest_; }

  RadioConfig config_;
  int domain_;
  AgentIdentity identity_;
  std::atomic<int> wish_all_;
  std::atomic<int> bytes_per_s_;
  Arena::Owned<ExchangeNode> node_;
  Arena::Owned<LinkSecurity> security_;  ///< nullptr: off
  std::optional<DdsSecurityFiles> dds_security_;
  std::size_t overhead_;    ///< of a datagram on the wire
  std::size_t most_bytes_;  ///< of a datagram
  ByteBudget budget_;
  std::unique_ptr<DdsRadio> radio_;
  MonotonicClock clock_;

  boost::lockfree::spsc_queue<DeltaPoseRecord> delta_poses_out_;
  boost::lockfree::spsc_queue<RangeRecord> ranges_out_;
  boost::lockfree::spsc_queue<std::byte> maplets_out_;
  boost::lockfree::spsc_queue<DeltaPoseRecord> delta_poses_in_;
  boost::lockfree::spsc_queue<RangeRecord> ranges_in_;
  boost::lockfree::spsc_queue<std::byte> maplets_in_;
  std::array<std::byte, kMaxMapletBytes> maplet_{};

  std::atomic<std::int64_t> record_clock_ns_{0};
  std::int64_t record_clock_set_ = 0;
  std::atomic<double> clock_rate_{1.0};
  std::atomic<bool> silent_{false};
  std::atomic<bool> stop_{false};
  std::atomic<bool> open_{false};
  std::atomic<bool> at_rest_{false};
  std::atomic<bool> touched_{false};
  std::atomic<bool> settled_{false};
  std::atomic<std::uint64_t> records_digest_{0};
  Instant retry_at_{};
  Instant looked_at_{};
  Instant announced_at_{};
  Instant opened_at_{};
  Instant noted_at_{};
  struct Warned {
    bool conflict = false;
    bool lives = false;
    bool future = false;
    bool open = false;
    bool sealed = false;
    std::uint64_t strangers = 0;
  } warned_;
  std::uint64_t sealed_heard_ = 0;
  std::uint64_t strangers_ = 0;
  std::uint64_t strangers_before_ = 0;  ///< while earlier links were open
  Instant busy_at_{};                   ///< something was heard, taken or missing
  std::uint32_t listeners_ = 0;
  std::uint64_t metered_ = 0;
  std::uint64_t wire_bytes_ = 0;
  std::uint64_t dds_bytes_ = 0;
  std::array<std::uint64_t, kTraffics> lane_bytes_{};

  mutable std::mutex mutex_;
  RadioStatus status_;
  std::array<MapletKey, 32> near_{};
  std::size_t near_count_ = 0;
  StaticVector<std::uint16_t, 32> related_;
  std::thread thread_;
};

}  // namespace maplet::daemon
