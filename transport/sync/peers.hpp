// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "core/base/arena.hpp"
#include "core/base/clock.hpp"
#include "transport/exchange/datagram.hpp"

namespace maplet {

/// What was still on its way when a life ended comes within this.
inline constexpr Duration kStragglers = std::chrono::seconds{5};
/// A peer heard within this hears us, most likely.
inline constexpr Duration kThere = std::chrono::seconds{10};

/// One life of another agent, as heard on the link.
struct Peer {
  Life life;
  Instant first_heard{};
  Instant last_heard{};
  bool superseded = false;  ///< a later life of the same agent was heard
  bool has_word = false;
  std::uint32_t word = 0;  ///< of its last beacon: what it holds
  Instant word_at{};
  std::uint32_t records = 0;  ///< that it said it holds
  std::uint16_t next_count = 0;
  std::uint64_t datagrams = 0;
  std::uint64_t lost = 0;  ///< datagrams, by the gaps in their count
  std::uint64_t bytes = 0;
  std::uint64_t new_records = 0;  ///< that it brought
  Stamp last_clock{};             ///< that it said, and when
  Instant last_clock_at{};
  bool has_offset = false;
  Duration clock_offset{};  ///< its record clock minus ours
  Duration delay{};         ///< of the exchange that the offset comes from, there and back
  Instant offset_at{};
};

/// Everybody heard so far.
///
/// Memory   a fixed table in the arena; when it is full, the one unheard for longest goes.
/// Time     O(peers). Threads one.
class Peers {
 public:
  Peers(std::size_t capacity, Arena& arena)
      : peers_{arena.make_array<Peer>(capacity, "exchange/peers")} {}

  /// Notes a datagram. @return its sender
  Peer& heard(const DatagramHead& head, std::size_t bytes, Instant now) noexcept;

  [[nodiscard]] std::span<Peer> all() noexcept { return peers_.first(count_); }
  [[nodiscard]] std::span<const Peer> all() const noexcept { return peers_.first(count_); }
  [[nodiscard]] Peer* find(const Life& life) noexcept;

  /// Agents of which two lives were heard in alternation: two devices with one id.
  [[nodiscard]] std::uint64_t conflicts() const noexcept { return conflicts_; }
  [[nodiscard]] std::optional<std::uint16_t> conflicting_agent() const noexcept {
    return conflicting_;
  }
  void note_conflict(std::uint16_t agent) noexcept {
    ++conflicts_;
    conflicting_ = agent;
  }

 private:
  Peer& add(const Life& life, Instant now) noexcept;

  std::span<Peer> peers_;
  std::size_t count_ = 0;
  std::uint64_t conflicts_ = 0;
  std::optional<std::uint16_t> conflicting_;
};

/// Takes in one answered exchange of clocks: keeps the one of the shortest way in the last minute.
///
/// @param sent  our record clock when the datagram left that the peer echoes
/// @param held  how long the peer kept it
/// @param theirs  its record clock in the answer
/// @param ours  our record clock now
void note_clocks(Peer& peer, Stamp sent, Duration held, Stamp theirs, Stamp ours,
                 Instant now) noexcept;

}  // namespace maplet
