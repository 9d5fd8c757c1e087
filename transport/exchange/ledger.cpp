// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/exchange/ledger.hpp"

#include <algorithm>

namespace maplet {

namespace {

/// The finaliser of SplitMix64 (Steele, Lea, Flood 2014): every input bit moves every output bit.
std::uint64_t mix(std::uint64_t x) noexcept {
  x += 0x9E3779B97F4A7C15U;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9U;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBU;
  return x ^ (x >> 31);
}

std::uint64_t hash(const RecordKey& key) noexcept {
  const std::uint64_t high = (std::uint64_t{key.agent} << 48) | (std::uint64_t{key.epoch} << 8) |
                             static_cast<std::uint64_t>(key.stream);
  return mix(mix(high) + key.seq);
}

}  // namespace

Ledger::Ledger(const Config& config, const Life& own, Arena& arena)
    : own_{own},
      rows_{arena.make_array<Row>(static_cast<std::size_t>(config.max_lives), "exchange/ledger")} {}

const Ledger::Row* Ledger::find(const Life& life) const noexcept {
  const auto all = rows();
  const auto at = std::lower_bound(all.begin(), all.end(), life,
                                   [](const Row& row, const Life& l) { return row.life < l; });
  return at != all.end() && at->life == life ? &*at : nullptr;
}

Ledger::Row* Ledger::row_of(const Life& life) noexcept {
  const auto end = rows_.begin() + static_cast<std::ptrdiff_t>(count_);
  const auto at = std::lower_bound(rows_.begin(), end, life,
                                   [](const Row& row, const Life& l) { return row.life < l; });
  if (at != end && at->life == life) return &*at;
  if (!has_room_for(life)) {
    ++refused_;
    ++lives_refused_;
    return nullptr;
  }
  std::move_backward(at, end, end + 1);
  *at = Row{};
  at->life = life;
  ++count_;
  return &*at;
}

Insert Ledger::insert(const RecordKey& key) noexcept {
  const auto stream = static_cast<std::size_t>(key.stream);
  if (stream >= kStreams) return Insert::kFull;
  Row* row = row_of({key.agent, key.epoch});
  if (row == nullptr) return Insert::kFull;
  const Insert result = row->held[stream].insert(key.seq);
  if (result == Insert::kNew) {
    if (key.stream != Stream::kMaplets) {
      digest_ += hash(key);  // a sum: the order does not matter
      ++records_;
    }
    row->known_end[stream] = std::max(row->known_end[stream], key.seq + 1);
  } else if (result == Insert::kFull) {
    ++refused_;
  }
  return result;
}

bool Ledger::contains(const RecordKey& key) const noexcept {
  const Row* row = find({key.agent, key.epoch});
  const auto stream = static_cast<std::size_t>(key.stream);
  return row != nullptr && stream < kStreams && row->held[stream].contains(key.seq);
}

bool Ledger::accepts(const RecordKey& key) const noexcept {
  const auto stream = static_cast<std::size_t>(key.stream);
  const Row* row = find({key.agent, key.epoch});
  if (stream >= kStreams || key.seq >= SeqSet::kSeqEnd) return false;
  if (row == nullptr) return has_room_for({key.agent, key.epoch});
  SeqSet copy = row->held[stream];
  return copy.insert(key.seq) != Insert::kFull;
}

void Ledger::expect(const Life& life, Stream stream, std::uint32_t end) noexcept {
  const auto index = static_cast<std::size_t>(stream);
  if (index >= kStreams) return;
  if (Row* row = row_of(life)) row->known_end[index] = std::max(row->known_end[index], end);
}

std::uint64_t Ledger::missing() const noexcept {
  std::uint64_t count = 0;
  for (const Row& row : rows()) {
    for (std::size_t i = 0; i < kStreams; ++i) {
      if (static_cast<Stream>(i) == Stream::kMaplets) continue;
      row.held[i].missing({0, row.known_end[i]},
                          [&](const SeqRange& gap) { count += gap.end - gap.first; });
    }
  }
  return count;
}

}  // namespace maplet
