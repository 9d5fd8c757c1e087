// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/flight_log.hpp"

#include <algorithm>
#include <cstring>

#include "drivers/flight/depth_code.hpp"

namespace maplet::daemon {

using flight::Block;
using flight::Event;

namespace {

constexpr std::size_t kEventHead = 3;

template <class T>
std::span<const std::byte> bytes_of(const T& value) noexcept {
  return std::as_bytes(std::span{&value, 1});
}

template <class T>
bool value_of(std::span<const std::byte> body, T& value) noexcept {
  if (body.size() < sizeof value) return false;
  std::memcpy(static_cast<void*>(&value), body.data(), sizeof value);
  return true;
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
  if (peek() != Event::kDecide || !value_of(body(), s)) return false;
  pass();
  a = s.a;
  b = s.b;
  accept = s.accept != 0;
  return true;
}

void FlightLog::repeat_operators(Agent& agent) noexcept {
  while (reader_ && (peek() == Event::kSay || peek() == Event::kDecide)) {
    const bool says = peek() == Event::kSay;
    Said s;
    const bool good = value_of(body(), s);
    pass();
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

bool FlightLog::fill() const noexcept {
  if (damaged_) return false;
  while (at_ + kEventHead > events_.size()) {
    const flight::RingReader::Entry* entry = reader_->next();
    if (entry == nullptr) return false;
    at_ = 0;
    events_.clear();
    if (entry->type != Block::kEvents) continue;  // pixels of a frame that nobody asked for
    if (!reader_->read(*entry, events_)) {
      events_.clear();
      damaged_ = true;  // what came after it would be taken for what came then
      return false;
    }
  }
  return true;
}

Event FlightLog::peek() const noexcept {
  if (!fill()) return {};
  return static_cast<Event>(events_[at_]);
}

std::span<const std::byte> FlightLog::body() const noexcept {
  if (!fill()) return {};
  const auto size = std::to_integer<std::size_t>(events_[at_ + 1]) |
                    std::to_integer<std::size_t>(events_[at_ + 2]) << 8;
  return std::span<const std::byte>{events_}.subspan(
      at_ + kEventHead, std::min(size, events_.size() - at_ - kEventHead));
}

void FlightLog::pass() const noexcept {
  at_ += kEventHead + body().size();
  ++passed_;
}

bool FlightLog::take(Event event) noexcept {
  if (!reader_ || peek() != event) return false;
  pass();
  return true;
}

void FlightLog::note_restored(const std::array<std::uint32_t, kStreams>& ends) noexcept {
  note_event(Event::kRestored, bytes_of(ends));
}

bool FlightLog::replayed_restored(std::array<std::uint32_t, kStreams>& ends) noexcept {
  if (peek() != Event::kRestored) return false;
  const bool good = value_of(body(), ends);
  pass();
  return good;
}

void FlightLog::note_stop(const SourceCounters& counters) noexcept {
  note_event(Event::kStop, bytes_of(counters));
}

void FlightLog::replayed_stop(SourceCounters& counters) noexcept {
  if (!reader_ || peek() != Event::kStop) return;
  (void)value_of(body(), counters);
  pass();
}

// A run that asks for other things than the one that was recorded (another configuration) may wait
// for what does not come: then the next event goes.
void FlightLog::keep_going() noexcept {
  if (!reader_ || over()) return;
  if (passed_ == passed_before_) pass();
  passed_before_ = passed_;
}

bool FlightLog::over() const noexcept {
  if (!reader_) return false;
  const Event next = peek();
  return next == Event{} || next == Event::kStop;
}

bool FlightLog::replayed(DeltaPoseRecord& record) noexcept {
  if (peek() != Event::kDelta) return false;
  ByteReader in{body()};
  RecordContext context{0, 0};
  const auto read = read_delta_pose(in, context);
  pass();
  if (read) record = *read;
  return read.has_value();
}

bool FlightLog::replayed(RangeRecord& record) noexcept {
  if (peek() != Event::kRange) return false;
  ByteReader in{body()};
  RecordContext context{0, 0};
  const auto read = read_range(in, context);
  pass();
  if (read) record = *read;
  return read.has_value();
}

bool FlightLog::replayed(RangeReport& report) noexcept {
  if (peek() != Event::kMeasured) return false;
  const bool good = value_of(body(), report);
  pass();
  return good;
}

std::size_t FlightLog::replayed_maplet(MapletKey& key, std::span<std::byte> bytes) noexcept {
  if (peek() != Event::kMaplet) return 0;
  const bool good = value_of(body(), key);
  pass();
  std::size_t size = 0;
  while (peek() == Event::kBytes) {
    const auto piece = body().first(std::min(body().size(), bytes.size() - size));
    std::ranges::copy(piece, bytes.begin() + static_cast<std::ptrdiff_t>(size));
    size += piece.size();
    pass();
  }
  return good ? size : 0;
}

bool FlightLog::read_pixels(flight::FrameNumbers& numbers) noexcept {
  DepthFrame& frame = numbers.frame;
  if (!flight::sane(numbers, most_)) return false;
  const auto* entry = reader_->next();
  if (entry == nullptr || entry->type != Block::kDepth || !reader_->read(*entry, block_))
    return false;
  depth_.resize(static_cast<std::size_t>(frame.depth.width_px) *
                static_cast<std::size_t>(frame.depth.height_px));
  if (!flight::decode_depth(block_, depth_)) return false;
  frame.depth.pixels = depth_.data();
  frame.depth.stride_px = frame.depth.width_px;
  ImageView<std::uint8_t>& gray = numbers.gray ? frame.gray : frame.gray_beside.pixels;
  if (!numbers.gray && !numbers.beside) return true;
  if (numbers.gray) gray = {nullptr, frame.depth.width_px, frame.depth.height_px, 0};
  entry = reader_->next();
  if (entry == nullptr || entry->type != Block::kGray || !reader_->read(*entry, gray_) ||
      gray_.size() != static_cast<std::size_t>(gray.width_px) *
                          static_cast<std::size_t>(std::max(gray.height_px, 0))) {
    return false;
  }
  gray.pixels = reinterpret_cast<const std::uint8_t*>(gray_.data());
  gray.stride_px = gray.width_px;
  return true;
}

// What lies before the next frame was asked for in the run that was recorded, and not in this one.
Expected<DepthFrame> FlightLog::replayed_frame() noexcept {
  for (;; pass()) {
    const Event next = peek();
    if (next == Event{} || next == Event::kStop) return fail(ErrorCode::kEnd, "the record is over");
    if (next == Event::kNoFrame) {
      std::uint8_t code = 0;
      const bool good = value_of(body(), code);
      pass();
      return fail(good ? static_cast<ErrorCode>(code) : ErrorCode::kTimeout, "as it was");
    }
    if (next != Event::kFrame) continue;
    std::array<std::byte, flight::kMostBody> bytes{};
    const auto recorded = body();
    std::ranges::copy(recorded.first(std::min(recorded.size(), bytes.size())), bytes.begin());
    flight::Body body{std::span{bytes}.first(std::min(recorded.size(), bytes.size()))};
    pass();
    flight::FrameNumbers numbers;
    visit(body, numbers, false);
    if (!body.good() || !read_pixels(numbers)) {
      damaged_ = true;
      return fail(ErrorCode::kEnd, "the record is damaged");
    }
    return numbers.frame;
  }
}

}  // namespace maplet::daemon
