// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/flight_log.hpp"

#include <algorithm>

namespace maplet::daemon {

using flight::Block;
using flight::Event;

namespace {

template <class T>
std::span<const std::byte> bytes_of(const T& value) noexcept {
  return std::as_bytes(std::span{&value, 1});
}

}  // namespace

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
  if (staged_.size() + flight::kEventHead + body.size() > kStaged) flush();
  staged_.push_back(static_cast<std::byte>(event));
  staged_.push_back(static_cast<std::byte>(body.size() & 0xFFU));
  staged_.push_back(static_cast<std::byte>(body.size() >> 8));
  staged_.insert(staged_.end(), body.begin(), body.end());
}

Instant FlightLog::now() const noexcept {
  if (events_) {
    std::int64_t ns = 0;
    if (events_->look(Event::kClock, ns)) {
      last_ = Instant{Duration{ns}};
      events_->pass();
    }
    return last_;
  }
  const Instant now = monotonic_.now();
  if (writer_) note_event(Event::kClock, bytes_of(now.time_since_epoch().count()));
  return now;
}

bool FlightLog::flag(bool value) noexcept {
  if (!events_) {
    if (writer_) note_event(Event::kFlag, bytes_of(static_cast<std::uint8_t>(value)));
    return value;
  }
  std::uint8_t was = 0;
  if (!events_->look(Event::kFlag, was)) return false;
  events_->pass();
  return was != 0;
}

Duration FlightLog::budget(Duration value) noexcept {
  std::int64_t ns = value.count();
  if (events_) {
    if (events_->look(Event::kBudget, ns)) {
      budget_ = Duration{ns};
      events_->pass();
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
  if (!events_) {
    if (value) note_event(Event::kOffset, bytes_of(ns));
    return value;
  }
  if (!events_->look(Event::kOffset, ns)) return {};
  events_->pass();
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

namespace {

struct Said {
  MapletKey a;
  MapletKey b;
  std::array<double, 7> T{};
  std::uint8_t accept = 0;
};

}  // namespace

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

bool FlightLog::replayed_decision(MapletKey& a, MapletKey& b, bool& accept) noexcept {
  Said s;
  if (!events_ || !events_->look(Event::kDecide, s)) return false;
  events_->pass();
  a = s.a;
  b = s.b;
  accept = s.accept != 0;
  return true;
}

void FlightLog::repeat_operators(Agent& agent) noexcept {
  while (peek() == Event::kSay || peek() == Event::kDecide) {
    const bool says = peek() == Event::kSay;
    Said s;
    const bool good = events_->look(peek(), s);
    events_->pass();
    if (!good) continue;
    if (!says) {
      (void)agent.decide(s.a, s.b, s.accept != 0, Deadline::never());
      continue;
    }
    DeltaPose closure;
    closure.kind = DeltaPose::Kind::kClosure;
    closure.a = s.a;
    closure.b = s.b;
    closure.T_a_b.se3 = {Eigen::Quaterniond{s.T[6], s.T[3], s.T[4], s.T[5]},
                         Eigen::Vector3d{s.T[0], s.T[1], s.T[2]}};
    closure.covariance.diagonal() << 1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3;
    (void)agent.say(closure, Deadline::never());
  }
}

bool FlightLog::take(Event event) noexcept {
  if (peek() != event) return false;
  events_->pass();
  return true;
}

void FlightLog::note_restored(const std::array<std::uint32_t, kStreams>& ends) noexcept {
  note_event(Event::kRestored, bytes_of(ends));
}

bool FlightLog::replayed_restored(std::array<std::uint32_t, kStreams>& ends) noexcept {
  if (peek() != Event::kRestored) return false;
  const bool good = events_->look(Event::kRestored, ends);
  events_->pass();
  return good;
}

void FlightLog::note_stop(const SourceCounters& counters) noexcept {
  note_event(Event::kStop, bytes_of(counters));
}

void FlightLog::replayed_stop(SourceCounters& counters) noexcept {
  if (peek() != Event::kStop) return;
  (void)events_->look(Event::kStop, counters);
  events_->pass();
}

bool FlightLog::replayed(DeltaPoseRecord& record) noexcept {
  if (peek() != Event::kDelta) return false;
  ByteReader in{events_->body()};
  RecordContext context{0, 0};
  const auto read = read_delta_pose(in, context);
  events_->pass();
  if (read) record = *read;
  return read.has_value();
}

bool FlightLog::replayed(RangeRecord& record) noexcept {
  if (peek() != Event::kRange) return false;
  ByteReader in{events_->body()};
  RecordContext context{0, 0};
  const auto read = read_range(in, context);
  events_->pass();
  if (read) record = *read;
  return read.has_value();
}

bool FlightLog::replayed(RangeReport& report) noexcept {
  if (peek() != Event::kMeasured) return false;
  const bool good = events_->look(Event::kMeasured, report);
  events_->pass();
  return good;
}

std::size_t FlightLog::replayed_maplet(MapletKey& key, std::span<std::byte> bytes) noexcept {
  if (peek() != Event::kMaplet) return 0;
  const bool good = events_->look(Event::kMaplet, key);
  events_->pass();
  std::size_t size = 0;
  while (peek() == Event::kBytes) {
    const auto body = events_->body();
    const auto piece = body.first(std::min(body.size(), bytes.size() - size));
    std::ranges::copy(piece, bytes.begin() + static_cast<std::ptrdiff_t>(size));
    size += piece.size();
    events_->pass();
  }
  return good ? size : 0;
}

}  // namespace maplet::daemon
