// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/journal/reader.hpp"

#include <algorithm>

namespace maplet::journal {

namespace {

constexpr std::uint16_t kFirstWithEnds = 2;  // version

/// What heads of version 1 do not say.
class EndsOf final : public Visitor {
 public:
  EndsOf(Life self, std::array<std::uint32_t, kStreams>& ends) noexcept
      : self_{self}, ends_{ends} {}
  void take(const DeltaPoseRecord& record) noexcept override { note(record.key); }
  void take(const RangeRecord& record) noexcept override { note(record.key); }
  void take(const MapletKey& key, float, std::span<const std::byte>) noexcept override {
    note({key.agent, key.epoch, Stream::kMaplets, key.id});
  }

 private:
  void note(const RecordKey& key) noexcept {
    if (Life{key.agent, key.epoch} != self_) return;
    std::uint32_t& end = ends_[static_cast<std::size_t>(key.stream)];
    end = std::max(end, key.seq + 1);
  }
  Life self_;
  std::array<std::uint32_t, kStreams>& ends_;
};

}  // namespace

std::optional<TurnHead> Reader::head_at(std::uint64_t at, Damage& damage) noexcept {
  const auto bytes = buffer_.first(kHeadBytes);
  if (file_.read(at, bytes) != bytes.size()) return {};
  return read_head(bytes, damage.mended_bits);
}

bool Reader::payload_at(std::uint64_t at, const TurnHead& head, Damage& damage) noexcept {
  const auto payload = buffer_.subspan(kHeadBytes, head.payload_bytes);
  return file_.read(at + kHeadBytes, payload) == payload.size() &&
         check_payload(head, payload, damage.mended_bits);
}

void Reader::take_head(Walk& walk, const TurnHead& head) noexcept {
  if (!walk.known) {
    walk.known = true;
    walk.life = head.life;
    walk.generation = head.generation;
    walk.half_pages = head.half_pages;
  }
  walk.counts = walk.counts || !head.carried;
  walk.version = std::min(walk.version, head.version);
}

// Turns of another generation, or with a number that was there already, are what an earlier lap
// left.
Reader::Walk Reader::walk(std::uint64_t from, std::uint64_t to, const OnTurn& on_turn) noexcept {
  Walk walk;
  walk.end = from;
  std::uint64_t gap = 0;
  std::uint64_t broken_bytes = 0;
  for (std::uint64_t at = from; at + kHeadBytes <= to && gap < kLookaheadPages;) {
    Damage here;
    const auto head = head_at(at, here);
    if (head) walk.most_generation = std::max(walk.most_generation, head->generation);
    if (head && head->version > kVersion) walk.newer = true;
    if (head && walk.known && head->generation != walk.generation) walk.older_lap = true;
    const bool ours =
        head && head->version <= kVersion &&
        (!walk.known || (head->generation == walk.generation && head->life == walk.life &&
                         head->number >= walk.next_number));
    if (!ours) {
      at += kPageBytes;
      ++gap;
      continue;
    }
    take_head(walk, *head);
    const std::uint64_t pages = pages_of(head->payload_bytes);
    if (!payload_at(at, *head, here)) {
      broken_bytes += kHeadBytes + head->payload_bytes;
      at += kPageBytes;  // its length may be true, but what it covers may not be its own
      ++gap;
      continue;
    }
    walk.damage.turns += head->number - walk.next_number;
    walk.damage.mended_bits += here.mended_bits;
    if (!on_turn(*head, buffer_.subspan(kHeadBytes, head->payload_bytes))) ++walk.damage.malformed;
    for (std::size_t i = 0; i < kStreams; ++i) walk.ends[i] = std::max(walk.ends[i], head->ends[i]);
    walk.next_number = head->number + 1;
    at += pages * kPageBytes;
    walk.end = at;
    gap = 0;
    broken_bytes = 0;
  }
  if (broken_bytes == 0 && walk.known && !walk.older_lap && walk.end < to && page_used(walk.end))
    broken_bytes = kPageBytes;  // at least: its head is gone
  walk.damage.tail_bytes = broken_bytes;
  return walk;
}

bool Reader::page_used(std::uint64_t at) noexcept {
  const auto page = buffer_.first(kPageBytes);
  const std::size_t bytes = file_.read(at, page);
  return std::ranges::any_of(page.first(bytes), [](std::byte b) { return b != std::byte{}; });
}

std::uint32_t Reader::find_half_pages() noexcept {
  const std::uint64_t middle = file_.size() / 2 / kPageBytes * kPageBytes;
  for (const std::uint64_t from : {std::uint64_t{0}, middle}) {
    for (std::uint64_t page = 0; page < kLookaheadPages; ++page) {
      Damage ignored;
      const auto head = head_at(from + page * kPageBytes, ignored);
      if (head) return head->half_pages;
    }
  }
  return 0;
}

Survey Reader::survey() noexcept {
  Survey survey;
  survey.half_pages = find_half_pages();
  if (survey.half_pages == 0) return survey;
  const std::uint64_t half_bytes = std::uint64_t{survey.half_pages} * kPageBytes;
  const OnTurn nothing = [](const TurnHead&, std::span<const std::byte>) { return true; };
  for (int half = 0; half < 2; ++half) {
    const std::uint64_t from = static_cast<std::uint64_t>(half) * half_bytes;
    const Walk walk = this->walk(from, from + half_bytes, nothing);
    survey.most_generation = std::max(survey.most_generation, walk.most_generation);
    if (walk.newer) {
      survey.state = Survey::State::kNewer;
      return survey;
    }
    if (!walk.counts || walk.generation <= survey.generation) continue;
    survey.state = Survey::State::kGood;
    survey.version = walk.version;
    survey.life = walk.life;
    survey.half = half;
    survey.generation = walk.generation;
    survey.next_number = walk.next_number;
    survey.end = walk.end;
    survey.ends = walk.ends;
    survey.damage = walk.damage;
  }
  if (survey.version < kFirstWithEnds) {
    EndsOf ends{survey.life, survey.ends};
    read(survey, ends);
  }
  const std::uint64_t size = file_.size();
  if (size < 2 * half_bytes) survey.damage.missing_bytes = 2 * half_bytes - size;
  return survey;
}

void Reader::read(const Survey& survey, Visitor& visitor) noexcept {
  if (survey.state != Survey::State::kGood) return;
  const std::uint64_t half_bytes = std::uint64_t{survey.half_pages} * kPageBytes;
  const std::uint64_t from = static_cast<std::uint64_t>(survey.half) * half_bytes;
  (void)walk(from, std::min(from + half_bytes, survey.end),
             [&](const TurnHead& head, std::span<const std::byte> payload) {
               return read_items(payload, head.life, visitor);
             });
}

}  // namespace maplet::journal
