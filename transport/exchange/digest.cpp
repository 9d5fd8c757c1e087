// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/exchange/digest.hpp"

#include <algorithm>

#include "transport/exchange/byte_io.hpp"

namespace maplet {

namespace {

// A digest: flags, [life covered from], [life covered to], lives. A life: an octet (4 bits mask of
// streams, 1 bit islands, 3 bits steps from the agent before; 7: a varint of them follows), epoch,
// and for each stream: next, and with islands their count and each as (gap, length).
constexpr std::uint64_t kHasFrom = 1;
constexpr std::uint64_t kHasTo = 2;
constexpr std::uint64_t kIslandsBit = 1U << kStreams;
constexpr unsigned kStepShift = kStreams + 1;
constexpr std::uint64_t kLongStep = 7;
constexpr std::size_t kLifeBytes = 7;  // at most

void write_life(ByteWriter& out, const Life& life) noexcept {
  out.varint(life.agent);
  out.fixed(life.epoch, 4);
}

Life read_life(ByteReader& in) noexcept {
  Life life;
  life.agent = static_cast<std::uint16_t>(in.varint_to(0xFFFF));
  life.epoch = static_cast<std::uint32_t>(in.fixed(4));
  return life;
}

void write_set(ByteWriter& out, const SeqSet& set, bool with_islands) noexcept {
  out.varint(set.next());
  if (!with_islands) return;
  out.varint(set.islands().size());
  std::uint32_t at = set.next();
  for (const SeqRange& island : set.islands()) {
    out.varint(island.first - at);
    out.varint(island.end - island.first);
    at = island.end;
  }
}

/// Ranges that a peer holds of one stream.
using Held = StaticVector<SeqRange, SeqSet::kIslands + 1>;

bool read_set(ByteReader& in, bool with_islands, Held& held) noexcept {
  const auto next = static_cast<std::uint32_t>(in.varint_to(SeqSet::kSeqEnd));
  const auto islands = with_islands ? in.varint_to(SeqSet::kIslands) : 0;
  if (next > 0) held.push_back({0, next});
  std::uint64_t at = next;
  for (std::uint64_t i = 0; i < islands && in.ok(); ++i) {
    const std::uint64_t gap = in.varint_to(SeqSet::kSeqEnd);
    const std::uint64_t length = in.varint_to(SeqSet::kSeqEnd);
    if (gap == 0 || length == 0 || at + gap + length > SeqSet::kSeqEnd) return false;
    at += gap;
    held.push_back({static_cast<std::uint32_t>(at), static_cast<std::uint32_t>(at + length)});
    at += length;
  }
  return in.ok();
}

void add(Difference& difference, Difference::Ranges& list, const KeyRange& range) noexcept {
  if (full(list)) {
    difference.complete = false;
  } else {
    list.push_back(range);
  }
}

/// Everything in `row` that is in none of `held`.
void they_lack(Difference& difference, const Ledger::Row& row, std::size_t stream,
               const Held& held) noexcept {
  row.held[stream].held([&](SeqRange ours) {
    for (const SeqRange& theirs : held) {
      if (theirs.end <= ours.first || theirs.first >= ours.end) continue;
      if (theirs.first > ours.first) {
        add(difference, difference.they_lack,
            {row.life, static_cast<Stream>(stream), {ours.first, theirs.first}});
      }
      ours.first = std::min(theirs.end, ours.end);
    }
    if (ours.first < ours.end) {
      add(difference, difference.they_lack, {row.life, static_cast<Stream>(stream), ours});
    }
  });
}

/// Lives of ours in (after, before) or up to the end: the peer's digest covers them, unnamed.
void they_know_nothing_of(Difference& difference, const Ledger& ledger,
                          const std::optional<Life>& after, const std::optional<Life>& before,
                          bool with_last) noexcept {
  for (const auto& row : ledger.rows()) {
    if (after && row.life <= *after) continue;
    if (before && (with_last ? row.life > *before : row.life >= *before)) return;
    for (std::size_t stream = 0; stream < kStreams; ++stream) {
      they_lack(difference, row, stream, {});
    }
  }
}

bool compare_life(ByteReader& in, std::uint64_t mask, const Life& life, Ledger& ledger,
                  Difference& difference) {
  for (std::size_t stream = 0; stream < kStreams; ++stream) {
    Held held;
    if ((mask >> stream & 1U) != 0 && !read_set(in, (mask & kIslandsBit) != 0, held)) return false;
    const auto name = static_cast<Stream>(stream);
    if (!held.empty()) ledger.expect(life, name, held.back().end);
    const Ledger::Row* row = ledger.find(life);
    if (row == nullptr) continue;  // no room for this life: nothing to ask for
    for (const SeqRange& range : held) {
      row->held[stream].missing(range, [&](const SeqRange& gap) {
        add(difference, difference.i_lack, {life, name, gap});
      });
    }
    they_lack(difference, *row, stream, held);
  }
  return in.ok();
}

}  // namespace

std::optional<Life> write_digest(const Ledger& ledger, const std::optional<Life>& after,
                                 std::span<std::byte> out, std::size_t& written) noexcept {
  // The lives go behind the longest head; the head is written when it is known where they end.
  const std::size_t head_room = 1 + 2 * kLifeBytes;
  written = 0;
  if (out.size() <= head_room) return after;
  ByteWriter body{out.subspan(head_room)};
  std::optional<Life> last = after;
  std::uint16_t agent = after ? after->agent : 0;
  bool all = true;
  for (const auto& row : ledger.rows()) {
    if (after && row.life <= *after) continue;
    const std::size_t start = body.size();
    std::uint64_t mask = 0;
    for (std::size_t i = 0; i < kStreams; ++i) {
      if (row.held[i].end() > 0) mask |= std::uint64_t{1} << i;
      if (!row.held[i].islands().empty()) mask |= kIslandsBit;
    }
    const std::uint64_t step = row.life.agent - agent;
    body.fixed(mask | std::min(step, kLongStep) << kStepShift, 1);
    if (step >= kLongStep) body.varint(step);
    body.fixed(row.life.epoch, 4);
    for (std::size_t i = 0; i < kStreams; ++i) {
      if ((mask >> i & 1U) != 0) write_set(body, row.held[i], (mask & kIslandsBit) != 0);
    }
    if (!body.ok()) {
      body.rewind(start);
      all = false;
      break;
    }
    last = row.life;
    agent = row.life.agent;
  }
  ByteWriter head{out.first(head_room)};
  head.varint((after ? kHasFrom : 0) | (all ? 0 : kHasTo));
  if (after) write_life(head, *after);
  if (!all) write_life(head, last.value_or(Life{}));
  std::copy_n(out.begin() + static_cast<std::ptrdiff_t>(head_room), body.size(),
              out.begin() + static_cast<std::ptrdiff_t>(head.size()));
  written = head.size() + body.size();
  return all ? std::nullopt : last;
}

Expected<Difference> read_digest(std::span<const std::byte> bytes, Ledger& ledger) noexcept {
  ByteReader in{bytes};
  Difference difference;
  const auto flags = in.varint_to(kHasFrom | kHasTo);
  std::optional<Life> before;
  std::optional<Life> to;
  if ((flags & kHasFrom) != 0) before = read_life(in);
  if ((flags & kHasTo) != 0) to = read_life(in);
  if (!in.ok()) return fail(ErrorCode::kBadInput, "digest: its head is damaged");
  std::uint64_t agent = before ? before->agent : 0;
  while (in.left() > 0) {
    const std::uint64_t mask = in.fixed(1);
    const std::uint64_t step = mask >> kStepShift;
    agent += step < kLongStep ? step : in.varint_to(0xFFFF);
    const auto epoch = static_cast<std::uint32_t>(in.fixed(4));
    if (agent > 0xFFFF) return fail(ErrorCode::kBadInput, "digest: no such agent");
    const Life life{static_cast<std::uint16_t>(agent), epoch};
    if (!in.ok() || (before && life <= *before) || (to && life > *to)) {
      return fail(ErrorCode::kBadInput, "digest: lives out of order");
    }
    they_know_nothing_of(difference, ledger, before, life, false);
    if (!compare_life(in, mask, life, ledger, difference)) {
      return fail(ErrorCode::kBadInput, "digest: a life is damaged");
    }
    before = life;
  }
  they_know_nothing_of(difference, ledger, before, to, true);
  return difference;
}

std::size_t write_ranges(std::span<const KeyRange> ranges, std::span<std::byte> out,
                         std::size_t& written) noexcept {
  ByteWriter writer{out};
  std::size_t count = 0;
  for (const KeyRange& range : ranges) {
    const std::size_t start = writer.size();
    write_life(writer, range.life);
    writer.varint(static_cast<std::uint64_t>(range.stream));
    writer.varint(range.seqs.first);
    writer.varint(range.seqs.end - range.seqs.first);
    if (!writer.ok()) {
      writer.rewind(start);
      break;
    }
    ++count;
  }
  written = writer.size();
  return count;
}

Expected<Difference::Ranges> read_ranges(std::span<const std::byte> bytes) noexcept {
  ByteReader in{bytes};
  Difference::Ranges ranges;
  while (in.left() > 0) {
    KeyRange range;
    range.life = read_life(in);
    range.stream = static_cast<Stream>(in.varint_to(kStreams - 1));
    const std::uint64_t first = in.varint_to(SeqSet::kSeqEnd);
    const std::uint64_t length = in.varint_to(SeqSet::kSeqEnd);
    if (!in.ok() || length == 0 || first + length > SeqSet::kSeqEnd || full(ranges)) {
      return fail(ErrorCode::kBadInput, "request: damaged");
    }
    range.seqs = {static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(first + length)};
    ranges.push_back(range);
  }
  return ranges;
}

}  // namespace maplet
