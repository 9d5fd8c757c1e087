// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/flight_log.hpp"

#include <algorithm>
#include <cstring>

#include "daemon/flight_bytes.hpp"

namespace maplet::daemon {

using flight::Block;
using flight::Event;

void FlightLog::record(std::unique_ptr<FlightWriter> writer, bool patient, std::size_t pixels) {
  writer_ = std::move(writer);
  patient_ = patient;
  staged_.reserve(kStaged);
  pixels_.reserve(pixels * sizeof(std::uint16_t));
}

void FlightLog::flush() const noexcept {
  if (staged_.empty()) return;
  writer_->put(Block::kEvents, staged_, patient_);
  staged_.clear();
}

void FlightLog::note_event(Event event, std::span<const std::byte> body) const noexcept {
  if (!writer_) return;
  if (staged_.size() + kEventHead + body.size() > kStaged) flush();
  staged_.push_back(static_cast<std::byte>(event));
  staged_.push_back(static_cast<std::byte>(body.size() & 0xFFU));
  staged_.push_back(static_cast<std::byte>(body.size() >> 8));
  staged_.insert(staged_.end(), body.begin(), body.end());
}

Instant FlightLog::now() const noexcept {
  if (reader_) {
    std::int64_t ns = 0;
    if (peek() == Event::kClock && value_of(body(), ns)) {
      last_ = Instant{Duration{ns}};
      pass();
    }
    return last_;
  }
  const Instant now = monotonic_.now();
  if (writer_) note_event(Event::kClock, bytes_of(now.time_since_epoch().count()));
  return now;
}

bool FlightLog::flag(bool value) noexcept {
  if (!reader_) {
    if (writer_) note_event(Event::kFlag, bytes_of(static_cast<std::uint8_t>(value)));
    return value;
  }
  std::uint8_t was = 0;
  if (peek() != Event::kFlag || !value_of(body(), was)) return false;
  pass();
  return was != 0;
}

Duration FlightLog::budget(Duration value) noexcept {
  std::int64_t ns = value.count();
  if (reader_) {
    if (peek() == Event::kBudget && value_of(body(), ns)) {
      budget_ = Duration{ns};
      pass();
    }
    return budget_.count() >= 0 ? budget_ : value;
  }
  if (writer_ && value != budget_) {
    budget_ = value;
    note_event(Event::kBudget, bytes_of(ns));
  }
  return value;
}

std::optional<Duration> FlightLog::offset(std::optional<Duration> value) noexcept {
  std::int64_t ns = value ? value->count() : 0;
  if (!reader_) {
    if (value) note_event(Event::kOffset, bytes_of(ns));
    return value;
  }
  if (peek() != Event::kOffset || !value_of(body(), ns)) return {};
  pass();
  return Duration{ns};
}

void FlightLog::note(const DeltaPoseRecord& record) noexcept {
  std::array<std::byte, kMaxRecordBytes> bytes;
  ByteWriter out{bytes};
  RecordContext context{0, 0};
  write_record(out, context, record);
  note_event(Event::kDelta, std::span{bytes}.first(out.size()));
}

void FlightLog::note(const RangeRecord& record) noexcept {
  std::array<std::byte, kMaxRecordBytes> bytes;
  ByteWriter out{bytes};
  RecordContext context{0, 0};
  write_record(out, context, record);
  note_event(Event::kRange, std::span{bytes}.first(out.size()));
}

void FlightLog::note(const RangeReport& report) noexcept {
  static_assert(std::is_trivially_copyable_v<RangeReport>);
  note_event(Event::kMeasured, bytes_of(report));
}

void FlightLog::note(const MapletKey& key, std::span<const std::byte> bytes) noexcept {
  note_event(Event::kMaplet, bytes_of(key));
  for (; !bytes.empty(); bytes = bytes.subspan(std::min(bytes.size(), flight::kMostBody)))
    note_event(Event::kBytes, bytes.first(std::min(bytes.size(), flight::kMostBody)));
}

template <class Pixel>
void FlightLog::note_pixels(Block type, const ImageView<Pixel>& image) noexcept {
  pixels_.clear();
  for (int v = 0; v < image.height_px; ++v) {
    const auto row =
        std::as_bytes(std::span{image.row(v), static_cast<std::size_t>(image.width_px)});
    pixels_.insert(pixels_.end(), row.begin(), row.end());
  }
  writer_->put(type, pixels_, patient_);
}

void FlightLog::note(const Expected<DepthFrame>& came) noexcept {
  if (!came) {
    note_event(Event::kNoFrame, bytes_of(static_cast<std::uint8_t>(came.error().code)));
    if (came.error().code != ErrorCode::kTimeout) flush();
    return;
  }
  flight::FrameNumbers numbers{*came, !came->gray.empty(), !came->gray_beside.pixels.empty()};
  std::array<std::byte, flight::kMostBody> bytes;
  flight::Body body{bytes};
  visit(body, numbers, true);
  note_event(Event::kFrame, std::span{bytes}.first(body.size()));
  flush();
  note_pixels(Block::kDepth, came->depth);
  if (numbers.gray) note_pixels(Block::kGray, came->gray);
  if (numbers.beside) note_pixels(Block::kGray, came->gray_beside.pixels);
}

void FlightLog::said(const DeltaPose& closure) noexcept {
  const Se3& T = closure.T_a_b.se3;
  note_event(Event::kSay,
             bytes_of(Said{closure.a,
                           closure.b,
                           {T.t.x(), T.t.y(), T.t.z(), T.q.x(), T.q.y(), T.q.z(), T.q.w()},
                           1}));
}

void FlightLog::decided(const MapletKey& a, const MapletKey& b, bool accept) noexcept {
  note_event(Event::kDecide, bytes_of(Said{a, b, {}, static_cast<std::uint8_t>(accept ? 1 : 0)}));
}

void FlightLog::note_restored(const std::array<std::uint32_t, kStreams>& ends) noexcept {
  note_event(Event::kRestored, bytes_of(ends));
}

void FlightLog::note_stop(const SourceCounters& counters) noexcept {
  note_event(Event::kStop, bytes_of(counters));
}

}  // namespace maplet::daemon
