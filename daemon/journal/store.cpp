// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/journal/store.hpp"

#include <algorithm>

namespace maplet::journal {

namespace {

constexpr std::size_t kMostSmall = 1024;  // parts, and decisions, that are carried over

/// How much there is of everything.
struct Tally final : Visitor {
  std::size_t maplets = 0;
  std::size_t maplet_bytes = 0;
  std::size_t records = 0;
  std::size_t parts = 0;
  std::size_t decisions = 0;
  std::size_t snapshots = 0;

  void take(const DeltaPoseRecord&) noexcept override { ++records; }
  void take(const RangeRecord&) noexcept override { ++records; }
  void take(const MapletKey&, float, std::span<const std::byte> bytes) noexcept override {
    ++maplets;
    maplet_bytes += bytes.size();
  }
  void take(const Part&) noexcept override { ++parts; }
  void take(const Decision&) noexcept override { ++decisions; }
  void take(const Poses& piece) noexcept override { snapshots += piece.first ? 1 : 0; }
};

std::size_t excess(std::size_t have, std::size_t keep) noexcept {
  return have > keep ? have - keep : 0;
}

}  // namespace

/// Writes what counts into the new half, turn by turn.
class Store::Carrier final : public Visitor {
 public:
  Carrier(Store& store, TurnBuilder& turn, const Tally& all, const Keep& keep) noexcept
      : store_{store},
        turn_{turn},
        all_{all},
        skip_maplets_{excess(all.maplets, keep.maplets)},
        most_maplet_bytes_{keep.maplet_bytes},
        left_bytes_{all.maplet_bytes},
        skip_records_{excess(all.records, keep.records)},
        skip_parts_{excess(all.parts, kMostSmall)},
        skip_decisions_{excess(all.decisions, kMostSmall)} {}

  void take(const DeltaPoseRecord& record) noexcept override { carry(skip_records_, record); }
  void take(const RangeRecord& record) noexcept override { carry(skip_records_, record); }
  void take(const MapletKey& key, float saliency,
            std::span<const std::byte> bytes) noexcept override {
    const bool too_many = left_bytes_ > most_maplet_bytes_;
    left_bytes_ -= bytes.size();
    if (skip_maplets_ > 0) {
      --skip_maplets_;
    } else if (!too_many) {
      add([&] { return turn_.add(key, saliency, bytes); });
    }
  }
  void take(const Part& part) noexcept override { carry(skip_parts_, part); }
  void take(const Decision& decision) noexcept override { carry(skip_decisions_, decision); }
  void take(const Poses& piece) noexcept override {
    snapshot_ += piece.first ? 1 : 0;
    if (snapshot_ == all_.snapshots) add([&] { return turn_.add(piece); });
  }

  [[nodiscard]] bool finish() noexcept {
    if (!turn_.empty()) write();
    return good_;
  }

 private:
  template <class Item>
  void carry(std::size_t& skip, const Item& item) noexcept {
    if (skip > 0) {
      --skip;
      return;
    }
    add([&] { return turn_.add(item); });
  }
  template <class Add>
  void add(Add&& add) noexcept {
    if (add()) return;
    write();
    good_ = add() && good_;
  }
  void write() noexcept {
    good_ = good_ && store_.write(turn_.turn(), true, store_.ends_);
    turn_.clear();
  }

  Store& store_;
  TurnBuilder& turn_;
  const Tally& all_;
  std::size_t skip_maplets_;
  std::size_t most_maplet_bytes_;
  std::size_t left_bytes_;
  std::size_t skip_records_;
  std::size_t skip_parts_;
  std::size_t skip_decisions_;
  std::size_t snapshot_ = 0;
  bool good_ = true;
};

void Store::begin(Life life, std::uint32_t half_pages) noexcept {
  life_ = life;
  half_pages_ = half_pages;
}

bool Store::go_on(const Survey& survey, const Keep& keep) noexcept {
  life_ = survey.life;
  half_pages_ = survey.half_pages;
  half_ = survey.half;
  generation_ = survey.generation;
  most_generation_ = survey.most_generation;
  number_ = survey.next_number;
  at_ = survey.end;
  ends_ = survey.ends;
  if (!file_.flush()) return false;  // what was read may still wait to be written
  return survey.version == kVersion || change_halves(keep, ends_);
}

bool Store::write(std::span<std::byte> turn, bool carried,
                  const std::array<std::uint32_t, kStreams>& ends) noexcept {
  const std::uint64_t bytes = pages_of(turn.size() - kHeadBytes) * kPageBytes;
  if (at_ + bytes > base() + half_bytes()) return false;
  TurnHead head;
  head.life = life_;
  head.generation = generation_;
  head.number = number_;
  head.half_pages = half_pages_;
  head.carried = carried;
  head.ends = ends;
  seal(head, turn);
  if (!file_.write(at_, turn)) return false;
  at_ += bytes;
  ++number_;
  bytes_written_ += bytes;
  if (carried) bytes_carried_ += bytes;
  return true;
}

bool Store::append(TurnBuilder& turn, const Keep& keep) noexcept {
  const std::uint64_t bytes = pages_of(turn.payload_bytes()) * kPageBytes;
  if (at_ + bytes > base() + half_bytes() && !change_halves(keep, ends_)) return false;
  const std::uint64_t before = at_;
  if (!write(turn.turn(), false, turn.ends())) return false;
  if (!file_.flush()) {  // whoever tries again writes the same turn to the same place
    at_ = before;
    --number_;
    return false;
  }
  ends_ = turn.ends();
  turn.clear();
  return true;
}

// The other half becomes valid by its first turn that is not carried over, after all those are
// safe. Until then the half that counts stays as it is.
bool Store::change_halves(const Keep& keep,
                          const std::array<std::uint32_t, kStreams>& ends) noexcept {
  Reader reader{file_, scratch_.first(kMaxTurnBytes)};
  const Survey from = [&] {
    Survey s;
    s.state = Survey::State::kGood;
    s.half_pages = half_pages_;
    s.half = half_;
    s.end = at_;
    return s;
  }();
  const Store before = *this;
  half_ = 1 - half_;
  generation_ = most_generation_ = std::max(generation_, most_generation_) + 1;
  number_ = 0;
  at_ = base();
  Tally all;
  reader.read(from, all);
  TurnBuilder carried{scratch_.subspan(kMaxTurnBytes, kMaxTurnBytes), life_};
  Carrier carrier{*this, carried, all, keep};
  reader.read(from, carrier);
  bool good = carrier.finish() && file_.flush();
  carried.clear();
  good = good && write(carried.turn(), false, ends) && file_.flush();
  if (good) return true;
  half_ = before.half_;
  generation_ = before.generation_;
  number_ = before.number_;
  at_ = before.at_;
  return false;
}

}  // namespace maplet::journal
