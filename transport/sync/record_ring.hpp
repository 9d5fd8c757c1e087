// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstdint>
#include <span>
#include <string_view>

#include "core/base/arena.hpp"
#include "core/base/clock.hpp"
#include "transport/exchange/record_key.hpp"

namespace maplet {

/// The newest `capacity` records of one type, found by their key: what a relay passes on.
///
/// Memory   capacity slots and as many buckets in the arena. Time O(1). Threads one.
template <class Record>
class RecordRing {
 public:
  struct Slot {
    Record record;
    Instant sent{};           ///< last; the epoch of the clock: never
    std::int32_t next = -1;   ///< in the bucket
    std::uint16_t count = 0;  ///< of the datagram that it was last sent in
  };

  RecordRing(std::size_t capacity, std::string_view component, Arena& arena)
      : slots_{arena.make_array<Slot>(capacity, component)},
        buckets_{arena.make_array<std::int32_t>(std::bit_ceil(capacity), component)} {
    for (std::int32_t& bucket : buckets_) bucket = -1;
  }

  /// Keeps a record that is not there yet; beyond the capacity the oldest goes.
  Slot& put(const Record& record) noexcept {
    const auto at = static_cast<std::int32_t>(count_ % slots_.size());
    if (count_ >= slots_.size()) unlink(at);
    ++count_;
    Slot& slot = slots_[at];
    std::int32_t& bucket = buckets_[bucket_of(record.key)];
    slot = {record, {}, bucket, 0};
    bucket = at;
    return slot;
  }
  [[nodiscard]] Slot* find(const RecordKey& key) noexcept {
    for (std::int32_t at = buckets_[bucket_of(key)]; at >= 0; at = slots_[at].next) {
      if (slots_[at].record.key == key) return &slots_[at];
    }
    return nullptr;
  }
  [[nodiscard]] std::uint64_t forgotten() const noexcept {
    return count_ > slots_.size() ? count_ - slots_.size() : 0;
  }

 private:
  [[nodiscard]] std::size_t bucket_of(const RecordKey& key) const noexcept {
    std::uint64_t h =
        (std::uint64_t{key.epoch} << 32 | key.seq) ^
        (std::uint64_t{key.agent} << 40 | static_cast<std::uint64_t>(key.stream) << 60);
    h = (h ^ h >> 30) * 0xBF58476D1CE4E5B9U;
    h = (h ^ h >> 27) * 0x94D049BB133111EBU;
    return static_cast<std::size_t>(h ^ h >> 31) & (buckets_.size() - 1);
  }
  void unlink(std::int32_t at) noexcept {
    std::int32_t* link = &buckets_[bucket_of(slots_[at].record.key)];
    while (*link != at) link = &slots_[*link].next;
    *link = slots_[at].next;
  }

  std::span<Slot> slots_;
  std::span<std::int32_t> buckets_;
  std::uint64_t count_ = 0;
};

}  // namespace maplet
