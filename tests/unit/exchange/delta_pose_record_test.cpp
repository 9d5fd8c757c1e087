// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/exchange/delta_pose_record.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <numbers>

#include "tests/support/records.hpp"

namespace maplet {
namespace {

TEST(DeltaPoseRecord, KeepsPoseWithinItsGrid) {
  std::mt19937 rng{1};
  for (std::uint32_t i = 0; i < 300; ++i) {
    const DeltaPose delta = test::random_delta(rng, 3, 9, i);
    const auto record = quantise(delta, 3, 9, i);
    ASSERT_TRUE(record);
    EXPECT_TRUE(valid(*record));
    const DeltaPose back = restore(*record);
    const Se3 error = delta.T_a_b.se3.inverse() * back.T_a_b.se3;
    EXPECT_LT(error.t.norm(), 0.87 * 0x1p-14);  // half a step in each of three directions
    EXPECT_LT(error.angle(), 0.87 * 0x1p-21);
    EXPECT_EQ(back.a, delta.a);
    EXPECT_EQ(back.b, delta.b);
    EXPECT_EQ(back.stamp_a, delta.stamp_a);
    EXPECT_EQ(back.stamp_b, delta.stamp_b);
    EXPECT_EQ(back.matches, delta.matches);
    EXPECT_NEAR(back.overlap, delta.overlap, 0.5F / 255.0F + 1e-6F);
  }
}

TEST(DeltaPoseRecord, QuantisingAgainKeepsPose) {
  std::mt19937 rng{2};
  for (std::uint32_t i = 0; i < 300; ++i) {
    const auto once = quantise(test::random_delta(rng, 1, 2, i), 1, 2, i);
    ASSERT_TRUE(once);
    const auto twice = quantise(restore(*once), 1, 2, i);
    ASSERT_TRUE(twice);
    EXPECT_EQ(twice->translation_m, once->translation_m);
    EXPECT_EQ(twice->rotation_rad, once->rotation_rad);
  }
}

TEST(DeltaPoseRecord, SurvivesHalfTurn) {
  for (const double angle : {std::numbers::pi, -std::numbers::pi, 3.14159}) {
    Vector6d xi = Vector6d::Zero();
    xi[4] = angle;
    DeltaPose delta;
    delta.b.id = 1;
    delta.T_a_b.se3 = Se3::exp(xi);
    delta.covariance = Matrix6d::Identity();
    const auto record = quantise(delta, 0, 0, 0);
    ASSERT_TRUE(record);
    EXPECT_TRUE(valid(*record));
    EXPECT_LT((delta.T_a_b.se3.inverse() * restore(*record).T_a_b.se3).angle(), 1e-6);
  }
}

TEST(DeltaPoseRecord, StreamFollowsKind) {
  std::mt19937 rng{3};
  DeltaPose delta = test::random_delta(rng);
  EXPECT_EQ(quantise(delta, 1, 7, 5)->key, (RecordKey{1, 7, Stream::kDeltaPoses, 5}));
  delta.kind = DeltaPose::Kind::kClosure;
  EXPECT_EQ(quantise(delta, 1, 7, 5)->key, (RecordKey{1, 7, Stream::kClosures, 5}));
}

TEST(DeltaPoseRecord, RefusesNonsense) {
  std::mt19937 rng{4};
  DeltaPose delta = test::random_delta(rng);
  delta.T_a_b.se3.t.x() = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(quantise(delta, 1, 7, 0));
  delta.T_a_b.se3.t.x() = 600.0;
  EXPECT_FALSE(quantise(delta, 1, 7, 0));
  delta.T_a_b.se3.t.x() = -511.9;
  EXPECT_TRUE(quantise(delta, 1, 7, 0));
  delta.T_a_b.se3.q.w() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(quantise(delta, 1, 7, 0));
}

TEST(DeltaPoseRecord, KnowsForeignRecords) {
  std::mt19937 rng{5};
  const auto good = quantise(test::random_delta(rng), 1, 7, 0);
  ASSERT_TRUE(good);
  auto bad = *good;
  bad.translation_m[1] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_FALSE(valid(bad));
  bad = *good;
  bad.translation_m[1] = 1e30F;
  EXPECT_FALSE(valid(bad));
  bad = *good;
  bad.rotation_rad = {3.0F, 3.0F, 0.0F};  // a vector longer than pi
  EXPECT_FALSE(valid(bad));
  bad = *good;
  bad.kind = static_cast<DeltaPose::Kind>(9);
  EXPECT_FALSE(valid(bad));
  bad = *good;
  bad.key.stream = Stream::kClosures;
  EXPECT_FALSE(valid(bad));
  bad = *good;
  bad.b = bad.a;
  EXPECT_FALSE(valid(bad));
}

}  // namespace
}  // namespace maplet
