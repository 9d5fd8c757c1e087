// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/exchange/json.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <limits>
#include <string>
#include <vector>

#include "tests/support/records.hpp"

namespace maplet {
namespace {

std::string text(const JsonLine& line) { return {line.data(), line.size()}; }

/// The numbers of the array called `name`.
std::vector<double> array_of(const std::string& line, const std::string& name) {
  const auto start = line.find("\"" + name + "\":[");
  std::vector<double> numbers;
  if (start == std::string::npos) return numbers;
  const char* at = line.c_str() + start + name.size() + 4;
  while (*at != ']' && *at != '\0') {
    char* end = nullptr;
    numbers.push_back(std::strtod(at, &end));
    if (end == at) break;
    at = *end == ',' ? end + 1 : end;
  }
  return numbers;
}

TEST(Json, DeltaPoseReadsAsDocumented) {
  DeltaPose delta;
  delta.a = {2, 41, 6};
  delta.b = {2, 41, 7};
  delta.stamp_a = Stamp{1305031102175304000};
  delta.stamp_b = Stamp{1305031103000000000};
  delta.T_a_b.se3.t = {0.5, -0.25, 0.0};
  delta.covariance = 0.25 * Matrix6d::Identity();
  delta.overlap = 1.0F;
  delta.matches = 9;
  std::string zeros;
  for (int i = 0; i < 6; ++i) zeros += ",0.0";
  std::string covariance = "0.25";
  for (int i = 0; i < 5; ++i) covariance += zeros + ",0.25";
  EXPECT_EQ(text(to_json(*quantise(delta, 2, 41, 3))),
            "{\"type\":\"delta_pose\",\"agent\":2,\"epoch\":41,\"stream\":\"delta_poses\","
            "\"seq\":3,\"kind\":\"consecutive\",\"a\":{\"agent\":2,\"epoch\":41,\"id\":6},"
            "\"b\":{\"agent\":2,\"epoch\":41,\"id\":7},\"stamp_a_s\":1305031102.175304,"
            "\"stamp_b_s\":1305031103.0,\"T_a_b\":[0.5,-0.25,0.0,0.0,0.0,0.0,1.0],"
            "\"covariance\":[" +
                covariance + "],\"overlap\":1.0,\"matches\":9}");
}

TEST(Json, NumbersReadBackExactly) {
  std::mt19937 rng{1};
  for (std::uint32_t i = 0; i < 100; ++i) {
    const auto record = quantise(test::random_delta(rng, 1, 2, i), 1, 2, i);
    const DeltaPose used = restore(*record);
    const std::string line = text(to_json(*record));
    const auto T = array_of(line, "T_a_b");
    const auto covariance = array_of(line, "covariance");
    ASSERT_EQ(T.size(), 7U);
    ASSERT_EQ(covariance.size(), 36U);
    EXPECT_EQ(T[2], used.T_a_b.se3.t.z());
    EXPECT_EQ(T[3], used.T_a_b.se3.q.x());
    EXPECT_EQ(T[6], used.T_a_b.se3.q.w());
    for (int k = 0; k < 36; ++k) EXPECT_EQ(covariance[k], used.covariance(k / 6, k % 6));
  }
}

TEST(Json, LongestLinesFit) {
  DeltaPoseRecord record;
  record.key = {65535, 4294967295U, Stream::kDeltaPoses, 4294967295U};
  record.a = record.b = {65535, 4294967295U, 4294967295U};
  record.stamp_a = record.stamp_b = Stamp{std::numeric_limits<std::int64_t>::min()};
  record.translation_m = {-511.99994F, -511.99988F, -511.9996F};
  record.rotation_rad = {-1.7777777F, -1.7777775F, -1.7777773F};
  record.covariance.sigma.fill(9.5414510e-07F);
  record.covariance.shape.fill(-32766);
  record.covariance.pivot.fill(61439);
  EXPECT_LT(to_json(record).size(), JsonLine::static_capacity);
  EXPECT_EQ(to_json(record).back(), '}');

  StatusRecord status;
  status.agent = 65535;
  status.epoch = 4294967295U;
  status.state = StatusRecord::State::kWaitingForInterface;
  status.stamp = Stamp{std::numeric_limits<std::int64_t>::min()};
  for (auto* count :
       {&status.uptime_ms, &status.frames_read, &status.frames_processed, &status.frames_dropped,
        &status.frames_lost, &status.arena_bytes, &status.rss_bytes}) {
    *count = std::numeric_limits<std::uint64_t>::max();
  }
  for (auto* count : {&status.keyframes, &status.maplets, &status.delta_poses, &status.closures,
                      &status.nodes, &status.factors, &status.messages_dropped}) {
    *count = std::numeric_limits<std::uint32_t>::max();
  }
  status.stages.fill({4294967295U, 4294967295U, 4294967295U, 4294967295U});
  EXPECT_EQ(to_json(status).back(), '}');
}

TEST(Json, StampsAreExactDecimals) {
  MapletRecord record;
  record.stamp = Stamp{-1};
  EXPECT_NE(text(to_json(record)).find("\"stamp_s\":-0.000000001,"), std::string::npos);
  record.stamp = Stamp{0};
  EXPECT_NE(text(to_json(record)).find("\"stamp_s\":0.0,"), std::string::npos);
  record.stamp = Stamp{std::numeric_limits<std::int64_t>::min()};
  EXPECT_NE(text(to_json(record)).find("\"stamp_s\":-9223372036.854775808,"), std::string::npos);
}

TEST(Json, MapletAndStatusReadAsDocumented) {
  const std::byte bytes[3] = {};
  EXPECT_EQ(text(to_json(MapletRecord{{1, 2, 3}, Stamp{4'500'000'000}, 5, 6, bytes})),
            "{\"type\":\"maplet\",\"agent\":1,\"epoch\":2,\"id\":3,\"stamp_s\":4.5,\"bytes\":3,"
            "\"planes\":5,\"keyframes\":6}");
  StatusRecord status;
  status.state = StatusRecord::State::kRunning;
  const std::string line = text(to_json(status));
  EXPECT_EQ(line.find("{\"type\":\"status\",\"agent\":0,\"epoch\":0,\"state\":\"running\","), 0U);
  for (const auto stage : kStageNames) EXPECT_NE(line.find(stage), std::string::npos);
}

}  // namespace
}  // namespace maplet
