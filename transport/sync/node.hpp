// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>
#include <optional>
#include <span>

#include "core/base/arena.hpp"
#include "core/base/clock.hpp"
#include "core/base/static_vector.hpp"
#include "transport/exchange/datagram.hpp"
#include "transport/exchange/delta_pose_record.hpp"
#include "transport/exchange/digest.hpp"
#include "transport/exchange/maplet_record.hpp"
#include "transport/exchange/range_record.hpp"
#include "transport/exchange/record_codec.hpp"
#include "transport/sync/maplet_trade.hpp"
#include "transport/sync/peers.hpp"
#include "transport/sync/record_ring.hpp"
#include "transport/sync/record_taker.hpp"
#include "transport/sync/scheduler.hpp"
#include "transport/sync/sync_config.hpp"

namespace maplet {

/// What a node counted since its start.
struct NodeCounters {
  std::uint64_t datagrams_in = 0;
  std::uint64_t datagrams_out = 0;
  std::uint64_t damaged = 0;      ///< CRC, length: dropped whole
  std::uint64_t future = 0;       ///< of a newer version: left alone
  std::uint64_t malformed = 0;    ///< intact, but making no sense
  std::uint64_t unknown = 0;      ///< entries of kinds that we do not know
  std::uint64_t duplicates = 0;   ///< records that we had
  std::uint64_t conflicting = 0;  ///< a key with another content: the first one stays
  std::uint64_t forged_own = 0;   ///< records under our own name that we never made
  std::uint64_t refused = 0;      ///< no room: they come again
  std::uint64_t received = 0;     ///< new records of others
};

/// One agent's end of the exchange: says what is new, finds out what is missing on either side,
/// relays what others lack. Pure logic: bytes in, bytes out, time as an argument.
///
/// Correct on any link that loses, repeats, delays and reorders datagrams: what is held is told in
/// digests, what is missing is asked for. After enough contact all hold the same records.
///
/// Memory   the arena, at construction.
/// Time     O(peers + maplets known) a call. Threads one.
/// Math     docs/dds.md, section "On the radio".
class ExchangeNode {
 public:
  ExchangeNode(const SyncConfig& config, const LinkProfile& profile, std::size_t maplet_bytes,
               Life self, RecordTaker& taker, Arena& arena);

  // What this agent makes. @return false when it cannot be kept: out of numbers, or no such life
  bool put(const DeltaPoseRecord& record, Instant now) noexcept;
  bool put(const RangeRecord& record, Instant now) noexcept;
  bool put(const MapletKey& key, std::span<const std::byte> bytes, float saliency,
           Instant now) noexcept;

  // What this agent or others made before it started again: held, but no news.
  void restore(const DeltaPoseRecord& record) noexcept;
  void restore(const RangeRecord& record) noexcept;
  void restore(const MapletKey& key, std::span<const std::byte> bytes, float saliency) noexcept;
  /// Own records of a stream were made up to here: those that are not restored are asked back of
  /// whoever has them.
  void restored(Stream stream, std::uint32_t end) noexcept;

  /// A datagram, or anything at all.
  void receive(std::span<const std::byte> bytes, Instant now) noexcept;

  struct Outgoing {
    Traffic lane = Traffic::kControl;  ///< which topic it belongs to
    std::span<const std::byte> bytes;  ///< empty: nothing to say now. Valid until the next call
  };
  /// The next datagram. Call it when the link has room for profile.datagram_bytes.
  /// @param bulk  pieces of maplets may go, too
  [[nodiscard]] Outgoing next(Instant now, bool bulk = true) noexcept;
  /// When next() may have something to say again; at once when something waits.
  [[nodiscard]] Instant due() const noexcept;

  /// The record clock stands at `stamp` now and goes on from there, at `rate` seconds a second of
  /// the clock that `now` is from.
  void set_record_clock(Stamp stamp, Instant now, double rate = 1.0) noexcept {
    clock_ahead_ = stamp - now.time_since_epoch();
    clock_set_ = now;
    clock_gain_ = rate - 1.0;
  }
  /// Silence: nothing is said, everything is heard.
  void set_silent(bool silent) noexcept { silent_ = silent; }
  [[nodiscard]] bool silent() const noexcept { return silent_; }
  /// The link was away or is new: tell at once what is held.
  void wake(Instant now) noexcept;

  [[nodiscard]] const Ledger& ledger() const noexcept { return ledger_; }
  [[nodiscard]] std::span<const Peer> peers() const noexcept { return peers_.all(); }
  [[nodiscard]] const Peers& peer_table() const noexcept { return peers_; }
  [[nodiscard]] const NodeCounters& counters() const noexcept { return counters_; }
  [[nodiscard]] const MapletTrade& maplets() const noexcept { return trade_; }
  [[nodiscard]] Life self() const noexcept { return self_; }
  /// Whether a peer's last word says that it holds the same records as we.
  [[nodiscard]] bool in_sync(const Peer& peer) const noexcept {
    return peer.has_word && peer.word == word();
  }
  /// Heard lately and all in sync, nothing waits to be sent.
  [[nodiscard]] bool settled(Instant now) const noexcept;
  /// Records came or were made in the last minute.
  [[nodiscard]] bool fresh(Instant now) const noexcept;
  /// Somebody was heard in the last ten minutes and is not any more.
  [[nodiscard]] bool somebody_away(Instant now) const noexcept;
  /// Nobody was heard for so long.
  [[nodiscard]] bool lonely(Instant now, Duration age) const noexcept;
  /// Maplets wanted and not here yet, or asked of us and not sent yet.
  [[nodiscard]] bool trading(Instant now) noexcept;

 private:
  struct Want {  // records to ask for
    KeyRange range;
    std::uint16_t holder = 0;
    Instant due{};
    int tries = 0;
    bool unasked = false;  ///< the holder sends it of itself, if all goes well
  };
  struct Again {  // our own news: said anew until those who are heard confirm
    KeyRange range;
    Instant due{};
    int left = 0;
  };
  using Ranges = StaticVector<KeyRange, 256>;

  /// An own record that was made in this run, not before.
  [[nodiscard]] bool is_new_own(const Life& life, Stream stream, std::uint32_t seq) const noexcept {
    return life == self_ && seq >= restored_[static_cast<std::size_t>(stream)];
  }

  // receive.cpp
  void take_entry(const DatagramReader::Entry& entry, Peer& peer, RecordContext& context,
                  bool& readable, Instant now) noexcept;
  template <class Record>
  void take_record(const Record& record, RecordRing<Record>& ring, Peer& peer,
                   Instant now) noexcept;
  void take_beacon(std::span<const std::byte> body, Peer& peer, Instant now) noexcept;
  void take_digest(std::span<const std::byte> body, Peer& peer, Instant now) noexcept;
  void take_request(std::span<const std::byte> body, Instant now) noexcept;
  /// What they lack and is not on its way to them. @param heard  our datagrams, up to this one
  void owe_lost(const KeyRange& range, std::optional<std::uint16_t> heard, Instant now) noexcept;
  /// @param other_holder  asked when the first one does not answer
  void want(const KeyRange& range, std::uint16_t holder, Instant due, std::uint16_t other_holder,
            bool unasked = false) noexcept;
  [[nodiscard]] std::uint16_t author_or(const Life& author, const Peer& peer,
                                        Instant now) const noexcept;
  [[nodiscard]] bool recently_heard(const Life& life, Instant now) const noexcept;
  [[nodiscard]] bool heard_within(std::uint16_t agent, Duration age, Instant now) const noexcept;
  void owe(const KeyRange& range) noexcept;
  void changed(Instant now) noexcept;
  void forget_owed() noexcept;

  // send.cpp
  [[nodiscard]] Waiting waiting(Instant now, bool bulk) noexcept;
  bool fill(DatagramWriter& out, RecordContext& context, Traffic traffic, Instant now) noexcept;
  template <class Record>
  bool fill_records(DatagramWriter& out, RecordContext& context, Ranges& owed,
                    RecordRing<Record>& ring, Instant now) noexcept;
  bool fill_control(DatagramWriter& out, Instant now) noexcept;
  bool write_requests(DatagramWriter& out, Instant now) noexcept;
  bool write_request(DatagramWriter& out, std::uint16_t holder, Instant now) noexcept;
  [[nodiscard]] SeqRange still_missing(const KeyRange& range) const noexcept;
  bool write_digest_entry(DatagramWriter& out, Instant now) noexcept;
  void write_heard(ByteWriter& out, Instant now) const noexcept;
  [[nodiscard]] std::uint16_t heard_of(std::uint16_t agent) const noexcept;
  bool write_beacon(DatagramWriter& out, bool brief, Instant now) noexcept;

  // node.cpp
  void say_news(const RecordKey& key, Instant now) noexcept;
  void say_again(Instant now) noexcept;
  [[nodiscard]] bool requests_due(Instant now) const noexcept;
  [[nodiscard]] bool all_in_sync(Instant now) const noexcept;
  [[nodiscard]] bool recent_peer_behind(Instant now, Duration age) const noexcept;
  [[nodiscard]] bool alone_with(const Peer& peer, Instant now) const noexcept;
  [[nodiscard]] bool records_flow(Instant now) const noexcept;
  [[nodiscard]] bool digest_wanted(Instant now) const noexcept;
  /// Of a few lives: no larger than what every datagram costs anyway.
  [[nodiscard]] bool small_digest() const noexcept { return ledger_.rows().size() <= 8; }
  [[nodiscard]] Duration interval(Instant now) noexcept;
  void say_by(Instant due) noexcept { say_at_ = std::min(say_at_, due); }
  [[nodiscard]] Duration jitter(Duration most) noexcept;
  [[nodiscard]] std::uint32_t word() const noexcept {
    const std::uint64_t digest = ledger_.records_digest();
    return static_cast<std::uint32_t>(digest ^ digest >> 32);
  }
  [[nodiscard]] Stamp record_clock(Instant now) const noexcept {
    const auto since = static_cast<double>((now - clock_set_).count());
    return now.time_since_epoch() + clock_ahead_ + Duration{std::llround(clock_gain_ * since)};
  }

  SyncConfig config_;
  LinkProfile profile_;
  Life self_;
  RecordTaker& taker_;
  Ledger ledger_;
  RecordRing<DeltaPoseRecord> delta_poses_;
  RecordRing<RangeRecord> ranges_;
  MapletTrade trade_;
  Peers peers_;
  Scheduler scheduler_;
  std::array<Ranges, 3> owed_;  ///< records to send: delta-poses, closures, ranges
  StaticVector<Want, 256> wants_;
  StaticVector<Again, 16> again_;
  std::optional<Life> digest_after_;  ///< the digest goes on behind this life
  Instant say_at_{};                  ///< digest or beacon
  Instant said_at_{};
  Instant digest_at_{};  ///< the last one
  Instant full_beacon_at_{};
  Instant flow_at_{};  ///< records came or went
  Instant came_at_{};  ///< a record
  Instant woken_at_{};
  Instant maplets_from_{};  ///< somebody is heard again: maplets wait until then
  std::array<std::uint32_t, kStreams> restored_{};
  Duration calm_{};  ///< the present interval while nothing happens
  Instant changed_at_{};
  std::uint16_t count_ = 0;
  std::uint64_t random_;
  Duration clock_ahead_{};
  Instant clock_set_{};
  double clock_gain_ = 0.0;
  bool silent_ = false;
  NodeCounters counters_;
  std::array<std::byte, kMaxDatagramBytes> buffer_{};
};

}  // namespace maplet
