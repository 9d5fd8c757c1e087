// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/exchange/record_codec.hpp"

#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "tests/support/records.hpp"
#include "transport/exchange/datagram.hpp"

namespace maplet {
namespace {

constexpr DatagramHead kHead{{1, 7}, 3};

/// Full datagrams of `bytes`; returns what their records cost each.
double bytes_per_record(const std::vector<DeltaPoseRecord>& records, std::size_t bytes) {
  std::size_t total = 0;
  std::size_t count = 0;
  std::vector<std::byte> buffer(bytes);
  for (std::size_t i = 0; i < records.size();) {
    DatagramWriter out{buffer, kHead};
    RecordContext context{kHead.sender.agent, kHead.sender.epoch};
    std::size_t in_this = 0;
    for (; i < records.size(); ++i, ++in_this) {
      std::array<std::byte, kMaxRecordBytes> body;
      ByteWriter writer{body};
      RecordContext after = context;
      write_record(writer, after, records[i]);
      if (!out.add(EntryKind::kDeltaPose, std::span{body}.first(writer.size()))) break;
      context = after;
    }
    if (i == records.size()) break;  // the last one is not full
    total += out.finish().size();
    count += in_this;
  }
  return static_cast<double>(total) / static_cast<double>(count);
}

std::vector<DeltaPoseRecord> chain(std::uint32_t count, Stamp period) {
  std::mt19937 rng{1};
  std::vector<DeltaPoseRecord> records;
  for (std::uint32_t i = 0; i < count; ++i) {
    DeltaPose delta = test::random_delta(rng, 1, 7, i);
    delta.stamp_a = Stamp{1305031102175304123} + i * period;
    delta.stamp_b = delta.stamp_a + period;
    records.push_back(*quantise(delta, 1, 7, i));
  }
  return records;
}

/// The same, held to the plane of a pitched camera.
DeltaPoseRecord in_plane(const DeltaPoseRecord& record, const Eigen::Vector3d& up) {
  const PlanarMotion planar{up.normalized()};
  DeltaPose delta = restore(record);
  delta.T_a_b.se3 = planar.project(delta.T_a_b.se3);
  delta.covariance = planar.restrict_covariance(delta.covariance);
  delta.plane = planar.code();
  return *quantise(delta, record.key.agent, record.key.epoch, record.key.seq);
}

const Eigen::Vector3d kPitched{0.02, -0.9, -0.4};

TEST(RecordCodec, RecordsFitTheirBytes) {
  // Nanosecond stamps, the long form.
  EXPECT_LE(bytes_per_record(chain(100, Stamp{1'033'000'001}), 1000), 100.0);
  EXPECT_LE(bytes_per_record(chain(100, Stamp{1'033'000'001}), 480), 100.0);
  std::vector<DeltaPoseRecord> planar;
  for (const auto& record : chain(100, Stamp{1'033'000'001}))
    planar.push_back(in_plane(record, kPitched));
  for (const auto& record : planar) ASSERT_TRUE(valid(record));
  EXPECT_LE(bytes_per_record(planar, 1000), 48.0);
  EXPECT_LE(bytes_per_record(planar, 480), 48.0);
}

TEST(RecordCodec, ALoneRecordMayAdd24Bytes) {
  const DeltaPoseRecord record = chain(4000, Stamp{1'033'000'001}).back();
  for (const auto& [one, limit] :
       {std::pair{record, 124U}, std::pair{in_plane(record, kPitched), 72U}}) {
    std::array<std::byte, 400> buffer;
    DatagramWriter out{buffer, kHead};
    RecordContext context{1, 7};
    std::array<std::byte, kMaxRecordBytes> body;
    ByteWriter writer{body};
    write_record(writer, context, one);
    ASSERT_TRUE(out.add(EntryKind::kDeltaPose, std::span{body}.first(writer.size())));
    EXPECT_LE(out.finish().size(), limit);
  }
}

TEST(RecordCodec, GivesBackWhatWasWritten) {
  std::mt19937 rng{2};
  for (int round = 0; round < 200; ++round) {
    std::vector<DeltaPoseRecord> records;
    std::vector<std::byte> buffer(2000);
    ByteWriter writer{buffer};
    RecordContext writing{1, 7};
    for (int i = 0; i < 8; ++i) {
      const auto agent = static_cast<std::uint16_t>(1 + rng() % 2 * 70000 % 65536);
      DeltaPose delta = test::random_delta(rng, agent, 7U + static_cast<std::uint32_t>(rng() % 2),
                                           static_cast<std::uint32_t>(rng() % 3));
      if (rng() % 3 == 0) delta.kind = DeltaPose::Kind::kClosure;
      if (rng() % 3 == 0) delta.b = {9, 1, static_cast<std::uint32_t>(rng())};
      if (rng() % 4 == 0) delta.stamp_a = Stamp{-static_cast<std::int64_t>(rng())};
      auto record = quantise(delta, agent, 7U + static_cast<std::uint32_t>(rng() % 2),
                             static_cast<std::uint32_t>(rng() % 5));
      ASSERT_TRUE(record);
      if (rng() % 3 == 0) record = in_plane(*record, kPitched);
      records.push_back(*record);
      write_record(writer, writing, *record);
    }
    ASSERT_TRUE(writer.ok());
    ByteReader reader{std::span{buffer}.first(writer.size())};
    RecordContext reading{1, 7};
    for (const auto& record : records) {
      const auto back = read_delta_pose(reader, reading);
      ASSERT_TRUE(back);
      EXPECT_EQ(*back, record);
    }
    EXPECT_EQ(reader.left(), 0U);
  }
}

// What a plane's record leaves out is what its plane says: a record that says more is none.
TEST(RecordCodec, APlanesRecordSaysNothingBesides) {
  const DeltaPoseRecord record = in_plane(chain(1, Stamp{1'033'000'001}).back(), kPitched);
  ASSERT_TRUE(valid(record));
  const auto changed = [&](auto change) {
    DeltaPoseRecord other = record;
    change(other);
    return valid(other);
  };
  EXPECT_FALSE(changed([](auto& r) { r.translation_m[1] = 1.0F; }));
  EXPECT_FALSE(changed([](auto& r) { r.rotation_rad[0] = 0.5F; }));
  EXPECT_FALSE(changed([](auto& r) { r.covariance.sigma[1] = 0x1p-9F; }));
  EXPECT_FALSE(changed([](auto& r) { r.covariance.pivot[0] = 1; }));
  EXPECT_FALSE(changed([](auto& r) { r.covariance.shape[0] = 1; }));
  EXPECT_FALSE(changed([](auto& r) { r.plane = PlaneCode{0x80000000U}; }));  // no direction
  EXPECT_TRUE(changed([](auto& r) { r.plane = PlanarMotion{{0.0, 0.0, 1.0}}.code(); }));
}

TEST(RecordCodec, RangesGiveBackWhatWasWritten) {
  const RangeRecord record{{1, 7, Stream::kRanges, 5}, {1, 7, 3}, {2, 8, 9},
                           Stamp{123456789},           12345,     100};
  ASSERT_TRUE(valid(record));
  std::array<std::byte, kMaxRecordBytes> body;
  ByteWriter writer{body};
  RecordContext writing{1, 7};
  write_record(writer, writing, record);
  RangeRecord second = record;
  second.key.seq = 6;
  write_record(writer, writing, second);
  ByteReader reader{std::span{body}.first(writer.size())};
  RecordContext reading{1, 7};
  EXPECT_EQ(*read_range(reader, reading), record);
  EXPECT_EQ(*read_range(reader, reading), second);
}

TEST(RecordCodec, TruncatedIsNoRecord) {
  const DeltaPoseRecord record = chain(1, Stamp{1'033'000'001}).back();
  std::array<std::byte, kMaxRecordBytes> body;
  ByteWriter writer{body};
  RecordContext writing{1, 7};
  write_record(writer, writing, record);
  for (std::size_t size = 0; size < writer.size(); ++size) {
    ByteReader reader{std::span{body}.first(size)};
    RecordContext reading{1, 7};
    EXPECT_FALSE(read_delta_pose(reader, reading)) << size;
  }
}

}  // namespace
}  // namespace maplet
