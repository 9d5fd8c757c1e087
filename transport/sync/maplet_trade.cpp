// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/sync/maplet_trade.hpp"

#include <algorithm>
#include <array>

#include "core/base/crc.hpp"

namespace maplet {

namespace {

constexpr std::uint8_t kMaxTries = 5;
constexpr std::uint32_t kMaxFailures = 6;

std::uint32_t pieces_of(std::uint32_t bytes) noexcept {
  return static_cast<std::uint32_t>((bytes + kPieceBytes - 1) / kPieceBytes);
}

/// Every encoded maplet ends in the CRC-32C of the rest.
bool intact(std::span<const std::byte> maplet) noexcept {
  if (maplet.size() < 4) return false;
  ByteReader tail{maplet.last(4)};
  return tail.fixed(4) == crc32c(maplet.first(maplet.size() - 4));
}

}  // namespace

MapletTrade::MapletTrade(const Config& config, Arena& arena)
    : config_{config},
      shelf_{config.kept, config.expected_bytes,   config.slot_bytes,
             arena,       "exchange/maplet slots", "exchange/maplets"},
      known_{arena.make_array<Known>(config.known, "exchange/maplets known")},
      assemblies_{arena.make_array<Assembly>(kAssemblies, "exchange/maplet assemblies")},
      jobs_{arena.make_array<Job>(kJobs, "exchange/maplet jobs")} {
  for (Assembly& assembly : assemblies_) {
    assembly.storage = arena.make_array<std::byte>(config.slot_bytes, "exchange/maplet pieces");
  }
}

bool MapletTrade::holds(const MapletKey& key) const noexcept { return shelf_.find(key) != nullptr; }

bool MapletTrade::keep(const MapletKey& key, std::span<const std::byte> bytes,
                       std::uint8_t saliency) noexcept {
  if (bytes.empty() || bytes.size() > config_.slot_bytes) {
    ++counters_.too_large;
    return false;
  }
  if (!shelf_.put(key, bytes, saliency)) return true;
  ++counters_.kept;
  counters_.forgotten = shelf_.forgotten();
  offered_ = std::max(offered_, shelf_.forgotten());
  if (Known* row = known(key, false)) row->used = false;
  return true;
}

MapletTrade::Known* MapletTrade::known(const MapletKey& key, bool add) noexcept {
  Known* free = nullptr;
  for (Known& row : known_) {
    if (row.used && row.key == key) return &row;
    if (!row.used && free == nullptr) free = &row;
  }
  if (!add || free == nullptr) return nullptr;
  *free = Known{};
  free->used = true;
  free->key = key;
  return free;
}

void MapletTrade::heard_offer(const MapletOffer& offer, std::uint16_t from, Instant now) noexcept {
  if (offer.bytes > config_.slot_bytes) ++counters_.too_large;
  if (offer.bytes == 0 || offer.bytes > config_.slot_bytes || holds(offer.key)) return;
  if (Known* row = known(offer.key, true)) {
    row->bytes = offer.bytes;
    row->holder = from;
    row->saliency = offer.saliency;
    if (row->tries >= kMaxFailures) row->tries = 0;
    row->not_before = std::min(row->not_before, now);
  }
}

void MapletTrade::heard_holding(const KeyRange& range, std::uint16_t from, Instant now) noexcept {
  constexpr std::uint32_t kMost = 64;  // a digest; the next one tells more
  std::uint32_t noted = 0;
  for (std::uint32_t seq = range.seqs.end; seq > range.seqs.first && noted < kMost; --seq) {
    const MapletKey key{range.life.agent, range.life.epoch, seq - 1};
    ++noted;
    if (holds(key)) continue;
    Known* row = known(key, true);
    if (row == nullptr) return;
    if (row->tries > 0 || row->holder == 0) row->holder = from;  // perhaps this one answers
    if (row->tries >= kMaxFailures) {
      row->tries = 0;
      row->not_before = now;
    }
  }
}

void MapletTrade::heard_request(const MapletRequest& request) noexcept {
  const auto* slot = shelf_.find(request.key);
  if (slot == nullptr) return;
  Job* job = nullptr;
  for (Job& other : jobs_.first(job_count_)) {
    if (other.key == request.key) job = &other;
  }
  if (job == nullptr) {
    if (job_count_ == kJobs) return;  // they ask again
    job = &jobs_[job_count_++];
    *job = {request.key, {}, slot->note};
  }
  const std::uint32_t pieces = pieces_of(slot->bytes);
  if (request.pieces.empty()) {
    for (std::uint32_t i = 0; i < pieces; ++i) job->pieces.set(i);
  }
  for (const SeqRange& run : request.pieces) {
    for (std::uint32_t i = run.first; i < std::min(run.end, pieces); ++i) job->pieces.set(i);
  }
  if (job->pieces.none()) *job = jobs_[--job_count_];
}

MapletTrade::Assembly* MapletTrade::assembly(const MapletKey& key) noexcept {
  for (Assembly& each : assemblies_) {
    if (each.used && each.key == key) return &each;
  }
  return nullptr;
}

MapletTrade::Assembly* MapletTrade::free_assembly() noexcept {
  for (Assembly& each : assemblies_) {
    if (!each.used) return &each;
  }
  return nullptr;
}

MapletTrade::Assembly* MapletTrade::start(const MapletKey& key, Known* from) noexcept {
  Assembly* free = free_assembly();
  if (free == nullptr) return nullptr;
  const std::span<std::byte> storage = free->storage;
  *free = Assembly{};
  free->storage = storage;
  free->used = true;
  free->key = key;
  if (from != nullptr) {
    free->holder = from->holder;
    free->saliency = from->saliency;
  }
  return free;
}

bool MapletTrade::heard_chunk(const MapletChunk& chunk, std::uint16_t from, RecordTaker& taker,
                              Instant now) noexcept {
  if (chunk.bytes > config_.slot_bytes || holds(chunk.key)) return false;
  Assembly* at = assembly(chunk.key);
  if (at == nullptr) {  // somebody else asked for it
    Known* row = known(chunk.key, true);
    if (row == nullptr || taker.wish(chunk.key, row->saliency / 255.0F) < 0.0F) return false;
    row->holder = from;
    at = start(chunk.key, row);
    if (at == nullptr) return false;
  }
  if (at->bytes == 0) {
    at->bytes = chunk.bytes;
    at->missing = pieces_of(chunk.bytes);
  }
  if (at->bytes != chunk.bytes || at->missing == 0) return false;
  std::copy(chunk.data.begin(), chunk.data.end(), at->storage.begin() + chunk.first * kPieceBytes);
  const auto count = pieces_of(static_cast<std::uint32_t>(chunk.data.size()));
  for (std::uint32_t i = chunk.first; i < chunk.first + count; ++i) {
    if (!at->have[i]) --at->missing;
    at->have.set(i);
  }
  at->due = now + config_.patience;
  at->tries = 0;
  if (at->missing > 0) return false;
  if (intact(at->whole())) return true;
  ++counters_.damaged;
  give_up(*at, now);
  return false;
}

void MapletTrade::give_up(Assembly& assembly, Instant now) noexcept {
  ++counters_.given_up;
  assembly.used = false;
  if (Known* row = known(assembly.key, false)) {
    ++row->tries;
    row->not_before = now + config_.patience * (2 << std::min(row->tries, 5U));
  }
}

MapletTrade::Assembly* MapletTrade::due_assembly(Instant now) noexcept {
  for (Assembly& each : assemblies_) {
    if (!each.used || each.missing == 0 || now < each.due) continue;
    if (each.tries < kMaxTries) return &each;
    give_up(each, now);
  }
  return nullptr;
}

MapletTrade::Known* MapletTrade::best_known(RecordTaker& taker, Instant now) noexcept {
  Known* best = nullptr;
  float best_wish = 0.0F;
  for (Known& row : known_) {
    if (!row.used || row.tries >= kMaxFailures || now < row.not_before) continue;
    if (assembly(row.key) != nullptr) continue;
    const float wish = taker.wish(row.key, row.saliency / 255.0F);
    if (wish < 0.0F || (best != nullptr && wish <= best_wish)) continue;
    best = &row;
    best_wish = wish;
  }
  return best;
}

bool MapletTrade::wants(RecordTaker& taker, Instant now) noexcept {
  if (due_assembly(now) != nullptr) return true;
  return free_assembly() != nullptr && best_known(taker, now) != nullptr;
}

bool MapletTrade::write_request(DatagramWriter& out, RecordTaker& taker, Instant now) noexcept {
  Assembly* at = due_assembly(now);
  if (at == nullptr && free_assembly() != nullptr) {
    if (Known* row = best_known(taker, now)) at = start(row->key, row);
  }
  if (at == nullptr) return false;
  MapletRequest request{at->holder, at->key, {}};
  if (at->bytes != 0) {
    const std::uint32_t pieces = pieces_of(at->bytes);
    for (std::uint32_t i = 0; i < pieces && !full(request.pieces); ++i) {
      if (at->have[i]) continue;
      if (!request.pieces.empty() && request.pieces.back().end == i) {
        ++request.pieces.back().end;
      } else {
        request.pieces.push_back({i, i + 1});
      }
    }
  }
  std::array<std::byte, 64> body;
  ByteWriter writer{body};
  write(writer, request);
  if (!writer.ok() || !out.add(EntryKind::kMapletRequest, std::span{body}.first(writer.size()))) {
    return false;
  }
  ++at->tries;
  at->due = now + config_.patience;
  return true;
}

bool MapletTrade::owes() const noexcept { return job_count_ > 0; }

bool MapletTrade::write_chunk(DatagramWriter& out) noexcept {
  while (job_count_ > 0) {
    Job* job =
        &*std::max_element(jobs_.begin(), jobs_.begin() + static_cast<std::ptrdiff_t>(job_count_),
                           [](const Job& a, const Job& b) { return a.saliency < b.saliency; });
    const auto* slot = shelf_.find(job->key);
    if (slot == nullptr || job->pieces.none()) {
      *job = jobs_[--job_count_];
      continue;
    }
    const std::size_t fits =
        out.room() < kChunkHeadBytes ? 0 : (out.room() - kChunkHeadBytes) / kPieceBytes;
    if (fits == 0) return false;
    std::uint32_t first = 0;
    while (!job->pieces[first]) ++first;
    std::uint32_t end = first;
    while (end < kMaxPieces && job->pieces[end] && end - first < fits) job->pieces.reset(end++);
    const std::size_t from = first * kPieceBytes;
    const std::size_t to = std::min<std::size_t>(end * kPieceBytes, slot->bytes);
    std::array<std::byte, kMaxDatagramBytes> body;
    ByteWriter writer{body};
    write(writer,
          MapletChunk{job->key, slot->bytes, first, shelf_.bytes(*slot).subspan(from, to - from)});
    counters_.bytes_sent += to - from;
    return out.add(EntryKind::kMapletChunk, std::span{body}.first(writer.size()));
  }
  return false;
}

bool MapletTrade::write_offer(DatagramWriter& out) noexcept {
  if (!offers()) return false;
  const auto& slot = shelf_.nth(offered_);
  std::array<std::byte, 32> body;
  ByteWriter writer{body};
  write(writer, MapletOffer{slot.key, slot.bytes, slot.note});
  if (!out.add(EntryKind::kMapletOffer, std::span{body}.first(writer.size()))) return false;
  ++offered_;
  return true;
}

}  // namespace maplet
