// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "core/skeleton/skeleton.hpp"
#include "tools/swarm/swarm_config.hpp"
#include "transport/sync/byte_budget.hpp"
#include "transport/sync/node.hpp"

namespace maplet::swarm {

/// What DDS, UDP and IP add to a datagram of ours (docs/dds.md).
inline constexpr std::size_t kWireOverheadBytes = 92;

/// One agent, without its camera: the exchange as mapletd has it, and a skeleton if it solves.
///
/// Memory   two arenas, each with mapletd's own ledger.
/// Threads  one at a time.
class Member final : private RecordTaker {
 public:
  /// @param records  delta-poses and closures that all agents will make: what is kept of them
  /// @param maplets  nodes of the skeleton; 0: it does not solve
  Member(const SwarmConfig& config, Life life, int records, int maplets, Instant now);

  /// Makes a record. @return nothing where it cannot be said (a way of 512 m)
  std::optional<DeltaPoseRecord> make(const DeltaPose& delta, Instant now);
  void receive(std::span<const std::byte> datagram, Instant now) { node_.receive(datagram, now); }
  /// Says what there is to say and the budget allows, to `listeners` that DDS takes for present.
  /// @param out  called with the bytes of each datagram
  template <class Out>
  void send(std::size_t listeners, Instant now, Out&& out) {
    if (listeners > listeners_) node_.wake(now);
    listeners_ = listeners;
    if (listeners == 0 || node_.due() > now) return;
    budget_.set_apart(node_.somebody_away(now));
    const std::size_t most = profile_.datagram_bytes + kWireOverheadBytes;
    while (budget_.allows(most, now, false)) {
      const auto datagram = node_.next(now, budget_.allows(most, now));
      if (datagram.bytes.empty()) return;
      const std::size_t wire = datagram.bytes.size() + kWireOverheadBytes;
      budget_.charge(wire, now);
      bytes_ += datagram.bytes.size();
      wire_bytes_ += wire;
      lane_bytes_[static_cast<std::size_t>(datagram.lane)] += datagram.bytes.size();
      out(datagram.bytes);
    }
  }

  [[nodiscard]] const ExchangeNode& node() const noexcept { return node_; }
  [[nodiscard]] bool holds(const RecordKey& key) const noexcept {
    return node_.ledger().contains(key);
  }
  [[nodiscard]] Skeleton* skeleton() noexcept { return skeleton_.get(); }
  [[nodiscard]] std::size_t exchange_bytes() const noexcept { return arena_.used_bytes(); }
  [[nodiscard]] std::size_t skeleton_bytes() const noexcept {
    return skeleton_arena_ ? skeleton_arena_->used_bytes() : 0;
  }
  [[nodiscard]] std::uint64_t bytes() const noexcept { return bytes_; }
  [[nodiscard]] std::uint64_t wire_bytes() const noexcept { return wire_bytes_; }
  [[nodiscard]] std::uint64_t lane_bytes(Traffic lane) const noexcept {
    return lane_bytes_[static_cast<std::size_t>(lane)];
  }

 private:
  [[nodiscard]] bool take(const DeltaPoseRecord& record) noexcept override;
  [[nodiscard]] bool take(const RangeRecord&) noexcept override { return true; }
  [[nodiscard]] bool take(const MapletKey&, std::span<const std::byte>) noexcept override {
    return true;
  }
  [[nodiscard]] float wish(const MapletKey&, float) noexcept override { return -1.0F; }

  LinkProfile profile_;
  // Many in one process: a 32-bit one has addresses for fifty such.
  Arena arena_{sizeof(void*) == 8 ? std::uint64_t{1} << 32 : std::uint64_t{1} << 25};
  ExchangeNode node_;
  ByteBudget budget_;
  std::optional<Arena> skeleton_arena_;
  Arena::Owned<Skeleton> skeleton_;
  std::array<std::uint32_t, 2> seqs_{};  ///< of delta-poses, closures
  std::size_t listeners_ = 0;
  std::uint64_t bytes_ = 0;
  std::uint64_t wire_bytes_ = 0;
  std::array<std::uint64_t, kTraffics> lane_bytes_{};
};

}  // namespace maplet::swarm
