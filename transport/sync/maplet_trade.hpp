// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bitset>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/base/byte_ring.hpp"
#include "core/base/clock.hpp"
#include "transport/exchange/datagram.hpp"
#include "transport/sync/messages.hpp"
#include "transport/sync/record_taker.hpp"

namespace maplet {

/// Maplets on the link: offered by who holds them, asked for by who wants them, sent in pieces.
///
/// Memory   a ByteRing of `kept`, kAssemblies times `slot_bytes`, `known` rows: in the arena.
/// Time     O(known + kept) a call. Threads one.
class MapletTrade {
 public:
  static constexpr std::size_t kAssemblies = 4;
  static constexpr std::size_t kJobs = 16;

  struct Config {
    std::size_t kept = 512;
    std::size_t known = 1024;
    std::size_t expected_bytes = 4096;            ///< of a maplet
    std::size_t slot_bytes = 8192;                ///< at most
    Duration patience = std::chrono::seconds{3};  ///< without a piece, before asking again
  };
  struct Counters {
    std::uint64_t kept = 0;
    std::uint64_t forgotten = 0;   ///< the oldest gave way
    std::uint64_t received = 0;    ///< whole
    std::uint64_t damaged = 0;     ///< whole, but the checksum is wrong
    std::uint64_t too_large = 0;   ///< for our slots
    std::uint64_t given_up = 0;    ///< nobody answered
    std::uint64_t bytes_sent = 0;  ///< of maplets
  };

  MapletTrade(const Config& config, Arena& arena);

  /// Keeps a whole maplet, to give away. @return false when it is too large for a slot
  bool keep(const MapletKey& key, std::span<const std::byte> bytes, std::uint8_t saliency) noexcept;
  [[nodiscard]] bool holds(const MapletKey& key) const noexcept;

  void heard_offer(const MapletOffer& offer, std::uint16_t from, Instant now) noexcept;
  void heard_holding(const KeyRange& range, std::uint16_t from, Instant now) noexcept;
  void heard_request(const MapletRequest& request) noexcept;
  /// @return whether a maplet became whole: then take_whole()
  bool heard_chunk(const MapletChunk& chunk, std::uint16_t from, RecordTaker& taker,
                   Instant now) noexcept;

  /// Hands whole maplets to the taker and the shelf.
  /// @param done  called with the key of each
  template <class Done>
  void hand_over(RecordTaker& taker, Done&& done) noexcept {
    for (Assembly& assembly : assemblies_) {
      if (!assembly.used || assembly.missing > 0) continue;
      if (!taker.take(assembly.key, assembly.whole())) continue;  // later
      (void)keep(assembly.key, assembly.whole(), assembly.saliency);
      ++counters_.received;
      assembly.used = false;
      done(assembly.key);
    }
  }

  /// Whether a request is due.
  [[nodiscard]] bool wants(RecordTaker& taker, Instant now) noexcept;
  /// Adds a request that is due. @return false when there is none or it does not fit
  bool write_request(DatagramWriter& out, RecordTaker& taker, Instant now) noexcept;
  [[nodiscard]] bool owes() const noexcept;
  /// Adds pieces of what was asked for. @return false when there are none or they do not fit
  bool write_chunk(DatagramWriter& out) noexcept;
  /// Adds an offer of a maplet kept since the last time. @return false when there is none
  bool write_offer(DatagramWriter& out) noexcept;
  /// What is kept by now is known to the others.
  void skip_offers() noexcept { offered_ = shelf_.count(); }
  [[nodiscard]] bool offers() const noexcept { return offered_ < shelf_.count(); }

  [[nodiscard]] const Counters& counters() const noexcept { return counters_; }

 private:
  struct Known {  ///< held by others, not by us
    MapletKey key;
    std::uint32_t bytes = 0;  ///< 0 = not said
    std::uint16_t holder = 0;
    std::uint8_t saliency = 128;
    bool used = false;
    Instant not_before{};
    std::uint32_t tries = 0;
  };
  struct Assembly {
    bool used = false;
    MapletKey key;
    std::uint32_t bytes = 0;  ///< 0 = not known yet
    std::uint32_t missing = 1;
    std::uint16_t holder = 0;
    std::uint8_t saliency = 0;
    std::uint8_t tries = 0;
    Instant due{};
    std::bitset<kMaxPieces> have;
    std::span<std::byte> storage;
    [[nodiscard]] std::span<const std::byte> whole() const noexcept { return storage.first(bytes); }
  };
  struct Job {
    MapletKey key;
    std::bitset<kMaxPieces> pieces;
    std::uint8_t saliency = 0;
  };

  Known* known(const MapletKey& key, bool add) noexcept;
  Assembly* assembly(const MapletKey& key) noexcept;
  Assembly* free_assembly() noexcept;
  [[nodiscard]] Known* best_known(RecordTaker& taker, Instant now) noexcept;
  [[nodiscard]] Assembly* due_assembly(Instant now) noexcept;
  Assembly* start(const MapletKey& key, Known* from) noexcept;
  void give_up(Assembly& assembly, Instant now) noexcept;

  Config config_;
  ByteRing<MapletKey, std::uint8_t> shelf_;  ///< the note is the saliency
  std::span<Known> known_;
  std::span<Assembly> assemblies_;
  std::span<Job> jobs_;
  std::size_t job_count_ = 0;
  std::uint64_t offered_ = 0;  ///< of those ever kept
  Counters counters_;
};

}  // namespace maplet
