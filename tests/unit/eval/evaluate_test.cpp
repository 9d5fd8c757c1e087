// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/eval/evaluate.hpp"

#include <gtest/gtest.h>

#include <numbers>

#include "tests/support/recordings.hpp"

namespace maplet::eval {
namespace {

using std::chrono::milliseconds;

Se3 at(double x, double y, double z) {
  return {Eigen::Quaterniond::Identity(), Eigen::Vector3d{x, y, z}};
}

Se3 turned(double rad, const Eigen::Vector3d& axis = Eigen::Vector3d::UnitY()) {
  return {Eigen::Quaterniond{Eigen::AngleAxisd{rad, axis}}, Eigen::Vector3d::Zero()};
}

/// A bent path, 10 poses a second.
Trajectory walk(int poses) {
  Trajectory out;
  for (int i = 0; i < poses; ++i) {
    const double s = 0.1 * i;
    const Se3 place = at(s, 0.3 * std::sin(s), 0.2 * s * s);
    out.push_back({milliseconds{100 * i}, place * turned(0.1 * s)});
  }
  return out;
}

Evaluation compare(const Trajectory& truth, const Trajectory& estimate) {
  return evaluate(associate(truth, estimate));
}

TEST(Evaluate, IsZeroForTheTruthInAnotherFrame) {
  const Trajectory truth = walk(40);
  const Se3 T = at(3, -1, 2) * turned(2.0, Eigen::Vector3d{1, 2, 3}.normalized());
  Trajectory estimate = truth;
  for (StampedPose& p : estimate) p.pose = T * p.pose;
  const Evaluation e = compare(truth, estimate);
  EXPECT_EQ(e.pairs, 40u);
  EXPECT_NEAR(e.ate_rms_m, 0.0, 1e-9);
  EXPECT_NEAR(e.rpe_frame.m, 0.0, 1e-9);
  EXPECT_NEAR(e.rpe_1s.deg, 0.0, 1e-6);
  EXPECT_EQ(e.rpe_frame.count, 39u);
  EXPECT_EQ(e.rpe_1s.count, 30u);
  EXPECT_LT((e.T_truth_estimate * T).log().norm(), 1e-9);
}

TEST(Evaluate, DoesNotForgiveScale) {
  // 0, 1, 2 m against 0, 1.1, 2.2 m: best moved by 0.1 m, which leaves 0.1, 0, 0.1 m.
  const Trajectory truth{{milliseconds{0}, at(0, 0, 0)},
                         {milliseconds{500}, at(1, 0, 0)},
                         {milliseconds{1000}, at(2, 0, 0)}};
  Trajectory estimate = truth;
  for (StampedPose& p : estimate) p.pose.t *= 1.1;
  const Evaluation e = compare(truth, estimate);
  EXPECT_NEAR(e.ate_rms_m, 0.1 * std::sqrt(2.0 / 3.0), 1e-12);
  EXPECT_NEAR(e.ate_max_m, 0.1, 1e-12);
  EXPECT_NEAR(e.path_m, 2.0, 1e-12);
  EXPECT_NEAR(e.rpe_frame.m, 0.1, 1e-12);
  EXPECT_NEAR(e.rpe_1s.m, 0.2, 1e-12);
  EXPECT_EQ(e.rpe_1s.count, 1u);
}

TEST(Evaluate, FindsTheBestAlignmentOfASquare) {
  // One corner of a 2 m square is 0.4 m out of its plane: shift and tilt leave z = 0.1 (+ - + -),
  // so the rms is 0.1 m, up to second order of the tilt.
  const double x[] = {1, 1, -1, -1};
  const double y[] = {1, -1, -1, 1};
  Trajectory truth;
  for (int i = 0; i < 4; ++i) truth.push_back({milliseconds{100 * i}, at(x[i], y[i], 0)});
  Trajectory estimate = truth;
  estimate[0].pose.t.z() = 0.4;
  EXPECT_NEAR(compare(truth, estimate).ate_rms_m, 0.1, 2e-3);
}

TEST(Evaluate, MeasuresDriftPerFrameAndPerSecond) {
  // Each frame the estimate goes 1 mm too far along its own z and turns 0.2 deg too much.
  const double drift_rad = 0.2 * std::numbers::pi / 180.0;
  const Trajectory truth = walk(31);
  Trajectory estimate = truth;
  for (std::size_t i = 1; i < truth.size(); ++i) {
    const Se3 step = truth[i - 1].pose.inverse() * truth[i].pose;
    estimate[i].pose = estimate[i - 1].pose * step * at(0, 0, 1e-3) * turned(drift_rad);
  }
  const Evaluation e = compare(truth, estimate);
  EXPECT_NEAR(e.rpe_frame.m, 1e-3, 1e-12);
  EXPECT_NEAR(e.rpe_frame.deg, 0.2, 1e-9);
  EXPECT_NEAR(e.rpe_1s.deg, 2.0, 1e-6);  // ten frames about one axis add up
}

TEST(Evaluate, HalfTurnIsNotWrappedAway) {
  const Trajectory truth = walk(4);
  Trajectory estimate = truth;
  estimate[2].pose = estimate[2].pose * turned(std::numbers::pi);
  const Evaluation e = compare(truth, estimate);
  EXPECT_NEAR(e.rpe_frame.deg, 180.0 * std::sqrt(2.0 / 3.0), 1e-5);
}

TEST(Evaluate, LeavesTheSecondOpenWhereThereIsNone) {
  const Evaluation e = compare(walk(5), walk(5));
  EXPECT_EQ(e.rpe_frame.count, 4u);
  EXPECT_EQ(e.rpe_1s.count, 0u);
}

TEST(Evaluate, GapIsNoSecond) {
  Trajectory estimate = walk(26);
  estimate.erase(estimate.begin() + 8, estimate.begin() + 18);  // lost from 0.8 s to 1.8 s
  const Evaluation e = compare(walk(26), estimate);
  EXPECT_EQ(e.pairs, 16u);
  EXPECT_EQ(e.rpe_1s.count, 0u);  // every partner a second away was lost
}

TEST(Evaluate, RefusesFewerThanThreePairs) {
  EXPECT_THROW((void)compare(walk(2), walk(9)), std::runtime_error);
  EXPECT_THROW((void)compare({}, walk(9)), std::runtime_error);
  EXPECT_THROW((void)compare(walk(9), {}), std::runtime_error);
  EXPECT_EQ(compare(walk(3), walk(9)).pairs, 3u);
}

TEST(Associate, TakesTheNearestWithinTolerance) {
  const Trajectory truth{{milliseconds{0}, at(0, 0, 0)},
                         {milliseconds{30}, at(1, 0, 0)},
                         {milliseconds{60}, at(2, 0, 0)}};
  const Trajectory estimate{{milliseconds{14}, at(0, 0, 0)},
                            {milliseconds{46}, at(0, 0, 0)},
                            {milliseconds{80}, at(0, 0, 0)},
                            {milliseconds{101}, at(0, 0, 0)}};
  const auto pairs = associate(truth, estimate);
  ASSERT_EQ(pairs.size(), 2u);
  EXPECT_EQ(pairs[0].stamp, milliseconds{14});
  EXPECT_EQ(pairs[0].truth.t.x(), 0.0);
  EXPECT_EQ(pairs[1].stamp, milliseconds{46});  // nearer than the one at 80 ms
  EXPECT_EQ(pairs[1].truth.t.x(), 2.0);
}

TEST(Associate, ToleranceIsInclusive) {
  const Trajectory truth{{milliseconds{0}, at(0, 0, 0)}};
  EXPECT_EQ(associate(truth, {{milliseconds{20}, at(0, 0, 0)}}).size(), 1u);
  EXPECT_EQ(associate(truth, {{milliseconds{-20}, at(0, 0, 0)}}).size(), 1u);
  EXPECT_EQ(associate(truth, {{Stamp{20'000'001}, at(0, 0, 0)}}).size(), 0u);
}

TEST(Evaluate, RealTruthMatchesItself) {
  MAPLET_RECORDING(recording, "rgbd/redkitchen_a");
  const Trajectory truth = read_tum(recording / "groundtruth.txt");
  const Evaluation e = compare(truth, truth);
  EXPECT_EQ(e.pairs, 500u);
  EXPECT_LT(e.ate_rms_m, 1e-9);
  EXPECT_GT(e.path_m, 2.0);
  EXPECT_EQ(e.rpe_1s.count, 470u);
}

}  // namespace
}  // namespace maplet::eval
