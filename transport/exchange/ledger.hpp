// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/base/field.hpp"
#include "transport/exchange/record_key.hpp"
#include "transport/exchange/seq_set.hpp"

namespace maplet {

/// One life of one agent.
struct Life {
  std::uint16_t agent = 0;
  std::uint32_t epoch = 0;

  friend auto operator<=>(const Life&, const Life&) = default;
};

/// Some records of one stream.
struct KeyRange {
  Life life;
  Stream stream = Stream::kDeltaPoses;
  SeqRange seqs;

  friend bool operator==(const KeyRange&, const KeyRange&) = default;
};

/// Which records of all agents this one holds, and which it knows to exist.
///
/// Order-free and idempotent: any sequence of the same insertions, repetitions included, gives the
/// same ledger, except for numbers refused with kFull, which are offered again.
///
/// Memory   max_lives rows in the arena.
/// Time     O(log lives + islands) a call.
/// Threads  one at a time.
class Ledger {
 public:
  struct Config {
    int max_lives = 256;

    static constexpr Field<Config> kFields[] = {
        {"max_lives", &Config::max_lives, 2, 1024,
         "Agents, each restart without a journal anew, whose records are told apart"},
    };
  };

  struct Row {
    Life life;
    std::array<SeqSet, kStreams> held;
    std::array<std::uint32_t, kStreams> known_end{};  ///< somebody has held up to here
  };

  /// @param own  there is always room for this life
  Ledger(const Config& config, const Life& own, Arena& arena);

  /// A record arrived, or was made. kNew: keep and use it; kDuplicate: drop it; kFull: drop it.
  Insert insert(const RecordKey& key) noexcept;
  [[nodiscard]] bool contains(const RecordKey& key) const noexcept;
  /// Whether insert() would not say kFull.
  [[nodiscard]] bool accepts(const RecordKey& key) const noexcept;
  /// A peer holds records up to `end` (exclusive). Nothing when there is no room for that life.
  void expect(const Life& life, Stream stream, std::uint32_t end) noexcept;

  /// Sorted by life.
  [[nodiscard]] std::span<const Row> rows() const noexcept { return rows_.first(count_); }
  [[nodiscard]] const Row* find(const Life& life) const noexcept;

  /// Equal for equal sets of records, whatever the order they came in. Maplets do not count: each
  /// agent keeps those that it wants.
  [[nodiscard]] std::uint64_t records_digest() const noexcept { return digest_; }
  [[nodiscard]] std::uint64_t records() const noexcept { return records_; }
  /// Lives and islands refused for want of room.
  [[nodiscard]] std::uint64_t refused() const noexcept { return refused_; }
  /// Times that a life was refused: there are agents whose records are not taken.
  [[nodiscard]] std::uint64_t lives_refused() const noexcept { return lives_refused_; }

  /// Records known to exist that are not held, maplets apart.
  [[nodiscard]] std::uint64_t missing() const noexcept;

 private:
  Row* row_of(const Life& life) noexcept;
  [[nodiscard]] bool has_room_for(const Life& life) const noexcept {
    const std::size_t kept_free = life == own_ || find(own_) != nullptr ? 0 : 1;
    return count_ + kept_free < rows_.size();
  }

  Life own_;
  std::span<Row> rows_;
  std::size_t count_ = 0;
  std::uint64_t digest_ = 0;
  std::uint64_t records_ = 0;
  std::uint64_t refused_ = 0;
  std::uint64_t lives_refused_ = 0;
};

}  // namespace maplet
