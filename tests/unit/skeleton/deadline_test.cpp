// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// What does not fit in a step is carried over.
#include <gtest/gtest.h>

#include "core/skeleton/skeleton.hpp"

namespace maplet {
namespace {

MapletKey key(std::uint32_t id) { return {1, 7, id}; }

DeltaPose delta(std::uint32_t a, std::uint32_t b, double x_m) {
  DeltaPose d;
  d.a = key(a);
  d.b = key(b);
  d.T_a_b.se3.t.x() = x_m;
  d.covariance = 1e-4 * Matrix6d::Identity();
  return d;
}

TEST(SkeletonDeadline, AClosureWaitsForItsVerdict) {
  Arena arena;
  Skeleton skeleton{{.max_nodes = 2048, .max_factors = 4096}, arena};
  ManualClock clock;
  const Deadline over{clock, Duration{0}};
  ASSERT_TRUE(over.expired());
  constexpr std::uint32_t kLast = 1500;  // all of them wait for their elimination, too
  for (std::uint32_t i = 0; i < kLast; ++i)
    skeleton.add(delta(i, i + 1, 2 * i < kLast ? 1.0 : -1.0), over);
  DeltaPose closure = delta(0, kLast, 0.02);
  closure.kind = DeltaPose::Kind::kClosure;
  EXPECT_EQ(skeleton.add(closure, over), Added::kLinked);
  const int last = skeleton.factor_count() - 1;
  EXPECT_EQ(skeleton.factor(last).verdict, ClosureState::kWaiting);
  EXPECT_FALSE(skeleton.settled());
  for (int k = 0; k < 200 && !skeleton.settled(); ++k) skeleton.update(Deadline::never());
  EXPECT_TRUE(skeleton.settled());
  EXPECT_EQ(skeleton.factor(last).verdict, ClosureState::kAccepted);
}

TEST(SkeletonDeadline, AVerdictByHandIsNotTakenBackByTheJudge) {
  Arena arena;
  Skeleton skeleton{{.max_nodes = 64, .max_factors = 128}, arena};
  ManualClock clock;
  const Deadline over{clock, Duration{0}};
  for (std::uint32_t i = 0; i < 10; ++i) skeleton.add(delta(i, i + 1, 1.0), over);
  DeltaPose closure = delta(0, 10, 10.0);
  closure.kind = DeltaPose::Kind::kClosure;
  skeleton.add(closure, over);
  EXPECT_EQ(skeleton.decide(key(0), key(10), false, Deadline::never()), 1);
  for (int k = 0; k < 200 && !skeleton.settled(); ++k) skeleton.update(Deadline::never());
  const auto view = skeleton.factor(skeleton.factor_count() - 1);
  EXPECT_EQ(view.verdict, ClosureState::kForced);
  EXPECT_EQ(view.weight, 0.0);
}

}  // namespace
}  // namespace maplet
