// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/exchange/record_codec.hpp"

#include <array>
#include <cmath>

namespace maplet {

namespace {

enum Flag : std::uint8_t {
  kClosure = 1,
  kPlanar = 2,
  kSameLife = 4,     // as the record before
  kNextSeq = 8,      // one more than the record before
  kChained = 16,     // a and its stamp are the record before's b
  kNextMaplet = 32,  // b is a's life and id + 1
  kMicroseconds = 64,
  kOwnMaplet = 128,  // a has the life of the record's key
};

constexpr double kTranslationUnit = 0x1p-14;
constexpr double kRotationUnit = 0x1p-21;
constexpr int kSigmaExponentMin = -19;  // of frexp: 2^-20 = 0.5 * 2^-19
constexpr int kSigmaExponents = 33;

constexpr std::size_t shape_index(std::size_t row, std::size_t column) noexcept {
  return row * (row - 1) / 2 + column;
}

void write_sigma(ByteWriter& out, float sigma) noexcept {
  int exponent = 0;
  const double mantissa = std::frexp(double{sigma}, &exponent);
  const auto steps = static_cast<unsigned>(std::lround(mantissa * 0x1p11));  // 1024..2047
  const unsigned e = static_cast<unsigned>(exponent - kSigmaExponentMin);
  out.fixed(e << 10 | (steps & 0x3FFU), 2);
}

float read_sigma(ByteReader& in) noexcept {
  const auto code = static_cast<unsigned>(in.fixed(2));
  const int exponent = static_cast<int>(code >> 10) + kSigmaExponentMin;
  if (static_cast<int>(code >> 10) >= kSigmaExponents) return 0.0F;  // not valid()
  return static_cast<float>(std::ldexp(static_cast<double>(1024 + (code & 0x3FFU)), exponent - 11));
}

void write_steps(ByteWriter& out, float value, double unit) noexcept {
  out.fixed(static_cast<std::uint64_t>(std::llround(value / unit)), 3);
}

float read_steps(ByteReader& in, double unit) noexcept {
  auto steps = static_cast<std::int32_t>(in.fixed(3));
  if (steps >= 1 << 23) steps -= 1 << 24;
  return static_cast<float>(steps * unit);
}

bool has_life(const MapletKey& maplet, const RecordKey& key) noexcept {
  return maplet.agent == key.agent && maplet.epoch == key.epoch;
}

void write_maplet(ByteWriter& out, const RecordKey& key, const MapletKey& maplet) noexcept {
  const bool same = has_life(maplet, key);
  out.fixed(same ? 0 : 1, 1);
  if (!same) {
    out.varint(maplet.agent);
    out.fixed(maplet.epoch, 4);
  }
  out.varint(maplet.id);
}

bool read_maplet(ByteReader& in, const RecordKey& key, MapletKey& maplet) noexcept {
  const auto marker = in.fixed(1);
  maplet.agent = key.agent;
  maplet.epoch = key.epoch;
  if (marker == 1) {
    maplet.agent = static_cast<std::uint16_t>(in.varint_to(0xFFFF));
    maplet.epoch = static_cast<std::uint32_t>(in.fixed(4));
  }
  maplet.id = static_cast<std::uint32_t>(in.varint_to(0xFFFFFFFF));
  return in.ok() && marker <= 1;
}

std::uint8_t key_flags(const RecordContext& context, const RecordKey& key) noexcept {
  const bool same_life = context.key.agent == key.agent && context.key.epoch == key.epoch;
  const bool next = same_life && context.key.stream == key.stream && key.seq == context.key.seq + 1;
  return static_cast<std::uint8_t>((same_life ? kSameLife : 0) | (next ? kNextSeq : 0));
}

void write_key(ByteWriter& out, std::uint8_t flags, const RecordKey& key) noexcept {
  if ((flags & kSameLife) == 0) {
    out.varint(key.agent);
    out.fixed(key.epoch, 4);
  }
  if ((flags & kNextSeq) == 0) out.varint(key.seq);
}

bool read_key(ByteReader& in, std::uint8_t flags, const RecordContext& context,
              RecordKey& key) noexcept {
  key.agent = context.key.agent;
  key.epoch = context.key.epoch;
  if ((flags & kSameLife) == 0) {
    if ((flags & kNextSeq) != 0) return false;
    key.agent = static_cast<std::uint16_t>(in.varint_to(0xFFFF));
    key.epoch = static_cast<std::uint32_t>(in.fixed(4));
  }
  if ((flags & kNextSeq) == 0) {
    key.seq = static_cast<std::uint32_t>(in.varint_to(0xFFFFFFFE));
  } else {
    if (context.key.stream != key.stream) return false;
    key.seq = context.key.seq + 1;
  }
  return in.ok();
}

bool whole_microseconds(Stamp stamp) noexcept { return stamp.count() % 1000 == 0; }

void write_stamp(ByteWriter& out, std::uint8_t flags, Stamp stamp, Stamp base) noexcept {
  const auto difference = static_cast<std::int64_t>(static_cast<std::uint64_t>(stamp.count()) -
                                                    static_cast<std::uint64_t>(base.count()));
  out.zigzag((flags & kMicroseconds) != 0 ? difference / 1000 : difference);
}

Stamp read_stamp(ByteReader& in, std::uint8_t flags, Stamp base) noexcept {
  const auto steps = static_cast<std::uint64_t>(in.zigzag());
  const std::uint64_t ns = (flags & kMicroseconds) != 0 ? steps * 1000 : steps;
  return Stamp{static_cast<std::int64_t>(static_cast<std::uint64_t>(base.count()) + ns)};
}

// In a plane only what it leaves: see DeltaPoseRecord::plane.
void write_pose(ByteWriter& out, const DeltaPoseRecord& record) noexcept {
  const bool planar = record.plane != PlaneCode::kSpace;
  const auto said = [planar](std::size_t axis) { return !planar || in_plane(axis); };
  if (planar) out.fixed(static_cast<std::uint32_t>(record.plane), 4);
  for (std::size_t i = 0; i < 3; ++i) {
    if (said(i)) write_steps(out, record.translation_m[i], kTranslationUnit);
  }
  for (std::size_t i = 0; i < 3; ++i) {
    if (said(3 + i)) write_steps(out, record.rotation_rad[i], kRotationUnit);
  }
  const CovarianceCode& code = record.covariance;
  for (std::size_t row = 0; row < 6; ++row) {
    if (!said(row)) continue;
    write_sigma(out, code.sigma[row]);
    for (std::size_t column = 0; column < row; ++column) {
      if (!said(column)) continue;
      out.fixed(static_cast<std::uint16_t>(code.shape[shape_index(row, column)]), 2);
    }
    if (row > 0) out.fixed(code.pivot[row - 1], 2);
  }
}

void read_pose(ByteReader& in, DeltaPoseRecord& record, bool planar) noexcept {
  const auto said = [planar](std::size_t axis) { return !planar || in_plane(axis); };
  if (planar) record.plane = PlaneCode{static_cast<std::uint32_t>(in.fixed(4))};
  for (std::size_t i = 0; i < 3; ++i) {
    if (said(i)) record.translation_m[i] = read_steps(in, kTranslationUnit);
  }
  for (std::size_t i = 0; i < 3; ++i) {
    if (said(3 + i)) record.rotation_rad[i] = read_steps(in, kRotationUnit);
  }
  CovarianceCode& code = record.covariance;
  for (std::size_t row = 0; row < 6; ++row) {
    code.sigma[row] = static_cast<float>(PlanarMotion::kTold);
    if (!said(row)) continue;
    code.sigma[row] = read_sigma(in);
    for (std::size_t column = 0; column < row; ++column) {
      if (!said(column)) continue;
      const auto bits = static_cast<std::uint16_t>(in.fixed(2));
      code.shape[shape_index(row, column)] = static_cast<std::int16_t>(bits);
    }
    if (row > 0) code.pivot[row - 1] = static_cast<std::uint16_t>(in.fixed(2));
  }
}

void remember(RecordContext& context, const DeltaPoseRecord& record) noexcept {
  context.key = record.key;
  context.has_maplet = true;
  context.b = record.b;
  context.stamp_b = record.stamp_b;
}

}  // namespace

void write_record(ByteWriter& out, RecordContext& context, const DeltaPoseRecord& record) noexcept {
  const bool chained =
      context.has_maplet && record.a == context.b && record.stamp_a == context.stamp_b;
  const bool next = record.b.agent == record.a.agent && record.b.epoch == record.a.epoch &&
                    record.b.id == record.a.id + 1;
  const bool us = whole_microseconds(record.stamp_a) && whole_microseconds(record.stamp_b);
  const bool own = !chained && has_life(record.a, record.key);
  const auto flags = static_cast<std::uint8_t>(
      (record.kind == DeltaPose::Kind::kClosure ? kClosure : 0) |
      (record.plane != PlaneCode::kSpace ? kPlanar : 0) | key_flags(context, record.key) |
      (chained ? kChained : 0) | (next ? kNextMaplet : 0) | (us ? kMicroseconds : 0) |
      (own ? kOwnMaplet : 0));
  out.fixed(flags, 1);
  write_key(out, flags, record.key);
  if (!chained) {
    if (own) {
      out.varint(record.a.id);
    } else {
      write_maplet(out, record.key, record.a);
    }
    write_stamp(out, flags, record.stamp_a, Stamp{});
  }
  if (!next) write_maplet(out, record.key, record.b);
  write_stamp(out, flags, record.stamp_b, record.stamp_a);
  write_pose(out, record);
  out.fixed(record.overlap, 1);
  out.fixed(record.matches, 1);
  remember(context, record);
}

Expected<DeltaPoseRecord> read_delta_pose(ByteReader& in, RecordContext& context) noexcept {
  DeltaPoseRecord record;
  const auto flags = static_cast<std::uint8_t>(in.fixed(1));
  record.kind = (flags & kClosure) != 0 ? DeltaPose::Kind::kClosure : DeltaPose::Kind::kConsecutive;
  record.key.stream = stream_of(record.kind);
  bool good = read_key(in, flags, context, record.key);
  if ((flags & kChained) != 0) {
    good = good && context.has_maplet && (flags & kOwnMaplet) == 0;
    record.a = context.b;
    record.stamp_a = context.stamp_b;
  } else {
    if ((flags & kOwnMaplet) != 0) {
      record.a = {record.key.agent, record.key.epoch,
                  static_cast<std::uint32_t>(in.varint_to(0xFFFFFFFF))};
    } else {
      good = good && read_maplet(in, record.key, record.a);
    }
    record.stamp_a = read_stamp(in, flags, Stamp{});
  }
  if ((flags & kNextMaplet) != 0) {
    record.b = {record.a.agent, record.a.epoch, record.a.id + 1};
  } else {
    good = good && read_maplet(in, record.key, record.b);
  }
  record.stamp_b = read_stamp(in, flags, record.stamp_a);
  read_pose(in, record, (flags & kPlanar) != 0);
  good = good && (record.plane != PlaneCode::kSpace) == ((flags & kPlanar) != 0);
  record.overlap = static_cast<std::uint8_t>(in.fixed(1));
  record.matches = static_cast<std::uint8_t>(in.fixed(1));
  if (!good || !in.ok() || !valid(record)) {
    return fail(ErrorCode::kBadInput, "delta-pose: damaged");
  }
  remember(context, record);
  return record;
}

void write_record(ByteWriter& out, RecordContext& context, const RangeRecord& record) noexcept {
  const bool us = whole_microseconds(record.stamp);
  const auto flags =
      static_cast<std::uint8_t>(key_flags(context, record.key) | (us ? kMicroseconds : 0));
  out.fixed(flags, 1);
  write_key(out, flags, record.key);
  write_maplet(out, record.key, record.a);
  write_maplet(out, record.key, record.b);
  write_stamp(out, flags, record.stamp, Stamp{});
  out.varint(record.range_mm);
  out.varint(record.sigma_mm);
  context.key = record.key;
}

Expected<RangeRecord> read_range(ByteReader& in, RecordContext& context) noexcept {
  RangeRecord record;
  record.key.stream = Stream::kRanges;
  const auto flags = static_cast<std::uint8_t>(in.fixed(1));
  constexpr std::uint8_t kKnown = kSameLife | kNextSeq | kMicroseconds;
  const bool good = (flags & ~kKnown) == 0 && read_key(in, flags, context, record.key) &&
                    read_maplet(in, record.key, record.a) && read_maplet(in, record.key, record.b);
  record.stamp = read_stamp(in, flags, Stamp{});
  record.range_mm = static_cast<std::uint32_t>(in.varint_to(0xFFFFFFFF));
  record.sigma_mm = static_cast<std::uint16_t>(in.varint_to(0xFFFF));
  if (!good || !in.ok() || !valid(record)) return fail(ErrorCode::kBadInput, "range: damaged");
  context.key = record.key;
  return record;
}

}  // namespace maplet
