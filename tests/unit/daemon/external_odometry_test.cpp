// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/external_odometry.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>

namespace maplet::daemon {
namespace {

using namespace std::chrono_literals;
using Verdict = ExternalOdometry::Verdict;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// A body that looks ahead: camera's z is its x.
Se3 base_camera() {
  return {Eigen::Quaterniond{0.5, -0.5, 0.5, -0.5}, Eigen::Vector3d{0.1, 0.0, 0.2}};
}

OdometryReport report_at(Stamp stamp, double x, double sigma = 0.0) {
  OdometryReport r;
  r.stamp_ns = stamp.count();
  r.writer = 1;
  r.t = {x, 0.0, 0.0};
  r.twist_covariance.diagonal().setConstant(sigma * sigma);
  return r;
}

struct Followed : testing::Test {
  ExternalOdometry external{OdometryConfig{}, base_camera()};
  [[nodiscard]] std::uint64_t count(Verdict v) const {
    return external.counters().by_verdict[static_cast<std::size_t>(v)];
  }
  /// 0.5 m/s along x, 50 Hz. @return where it ends
  double drive(Stamp from, Stamp to, double x, double sigma = 0.0) {
    for (Stamp s = from; s < to; s += 20ms, x += 0.01) external.take(report_at(s, x, sigma), s);
    return x;
  }
  MotionHint tracked_at(Stamp s) {
    MotionHint hint = external.at(s);
    external.tracked();
    return hint;
  }
};

TEST_F(Followed, CarriesTheBasesMotionToTheCamera) {
  drive(0s, 2s, 0.0);
  (void)tracked_at(500ms);
  const MotionHint a = tracked_at(500ms);
  const MotionHint b = tracked_at(1490ms);  // between two reports
  ASSERT_TRUE(a.has_pose && b.has_pose);
  const Se3 moved = a.T_external_camera.inverse() * b.T_external_camera;
  EXPECT_NEAR(moved.t.z(), 0.495, 1e-9);  // ahead is the camera's z
  EXPECT_LT(moved.t.head<2>().norm(), 1e-9);
  EXPECT_TRUE(b.path_covariance.isZero()) << "it has not said how sure it is";
}

TEST_F(Followed, TakesTheTwistsCovarianceForEachStep) {
  drive(0s, 1s, 0.0, 0.1);
  (void)tracked_at(0s);
  const Matrix6d path =
      tracked_at(900ms).path_covariance - tracked_at(400ms).path_covariance;  // 25 steps
  EXPECT_NEAR(path(2, 2), 25 * std::pow(0.1 * 0.02, 2), 0.1 * path(2, 2));
  EXPECT_GT(path(0, 0), path(2, 2)) << "a turn of the base moves a camera in front of it aside";
}

TEST_F(Followed, TakesWhatThePosesCovarianceGrowsBy) {
  double x = 0.0;
  for (Stamp s = 0s; s < 1s; s += 20ms, x += 0.01) {
    OdometryReport r = report_at(s, x);
    r.covariance.diagonal().setConstant(1e-4 + 1e-4 * seconds(s));
    external.take(r, s);
  }
  (void)tracked_at(0s);
  const Matrix6d path = tracked_at(900ms).path_covariance - tracked_at(400ms).path_covariance;
  EXPECT_NEAR(path(0, 0), 0.5e-4 * 1.05, 1e-6);  // across, and levers of 0.1 and 0.2 m
}

TEST_F(Followed, IsGoodForAMomentBehindItsLastReport) {
  drive(0s, 1s, 0.0);  // the last one is of 0.98 s
  (void)tracked_at(980ms);
  EXPECT_TRUE(tracked_at(1010ms).has_pose);
  EXPECT_FALSE(tracked_at(1100ms).has_pose);
  EXPECT_FALSE(external.at(10s).has_pose);
  EXPECT_FALSE(external.at(Stamp{-1}).has_pose);
}

TEST_F(Followed, RefusesWhatIsNoPose) {
  drive(0s, 1s, 0.0);
  for (int i = 0; i < 7; ++i) {
    OdometryReport r = report_at(1s, 0.5);
    if (i == 0) r.t.x() = kNan;
    if (i == 1) r.q = {0.0, 0.0, 0.0, 2.0};
    if (i == 2) r.q.setZero();
    if (i == 3) r.q.setConstant(kNan);
    if (i == 4) r.t.y() = 1e9;
    if (i == 5) r.twist_covariance(3, 3) = kNan;
    if (i == 6) r.covariance(0, 1) = std::numeric_limits<double>::infinity();
    external.take(r, 1s);
  }
  EXPECT_EQ(count(Verdict::kMalformed), 7U);
  EXPECT_EQ(count(Verdict::kUsed), 50U);
}

TEST_F(Followed, RefusesStampsOfAnotherClockAndThoseThatGoBack) {
  drive(0s, 1s, 0.0);
  external.take(report_at(Stamp{std::chrono::hours{480'000}}, 0.5), 1s);
  external.take(report_at(-10s, 0.5), 1s);
  external.take(report_at(500ms, 0.5), 1s);
  EXPECT_EQ(count(Verdict::kOtherClock), 2U);
  EXPECT_EQ(count(Verdict::kBackwards), 1U);
  EXPECT_EQ(external.counters().restarts, 0U);
}

TEST_F(Followed, AClockThatBeganAnewIsFollowedAgain) {
  drive(2s, 3s, 0.0);
  (void)tracked_at(2900ms);
  drive(0s, 1s, 0.0);
  EXPECT_EQ(external.counters().restarts, 1U);
  EXPECT_GT(count(Verdict::kUsed), 50U);
}

TEST_F(Followed, TenThousandASecondAreThinned) {
  for (int i = 0; i < 10'000; ++i) external.take(report_at(i * 100us, 0.5e-4 * i), i * 100us);
  EXPECT_EQ(count(Verdict::kUsed), 500U);
  EXPECT_EQ(count(Verdict::kTooOften), 9500U);
}

TEST_F(Followed, ALeapIsRefusedAndWhatComesBackIsTaken) {
  const double x = drive(0s, 1s, 0.0);
  external.take(report_at(1s, x + 50.0), 1s);
  external.take(report_at(1020ms, x + 0.01), 1020ms);
  EXPECT_EQ(count(Verdict::kLeapt), 1U);
  EXPECT_EQ(count(Verdict::kUsed), 51U);
}

// A pose that was set anew says nothing of the way there, whatever was seen meanwhile.
TEST_F(Followed, APoseThatWasSetAnewIsSilentUntilAFrameIsTracked) {
  drive(0s, 1s, 0.0);
  (void)tracked_at(960ms);
  EXPECT_TRUE(tracked_at(970ms).has_pose);
  drive(1s, 2s, 100.0);
  EXPECT_EQ(external.counters().restarts, 1U);
  EXPECT_FALSE(external.at(1500ms).has_pose) << "in the dark";
  EXPECT_FALSE(external.at(1800ms).has_pose);
  EXPECT_FALSE(tracked_at(1900ms).has_pose);
  EXPECT_TRUE(tracked_at(1950ms).has_pose);
}

TEST_F(Followed, OfTwoPublishersTheFirstHasTheWord) {
  drive(0s, 1s, 0.0);
  OdometryReport other = report_at(1s, -3.0);
  other.writer = 2;
  external.take(other, 1s);
  EXPECT_EQ(count(Verdict::kOtherPublisher), 1U);
  other.stamp_ns = Stamp{3s}.count();  // the first has been silent for two seconds
  external.take(other, 3s);
  EXPECT_EQ(count(Verdict::kUsed), 51U);
  EXPECT_EQ(external.counters().restarts, 1U);
}

TEST_F(Followed, ACovarianceThatIsNoneIsLeft) {
  double x = 0.0;
  for (Stamp s = 0s; s < 1s; s += 20ms, x += 0.01) {
    OdometryReport r = report_at(s, x);
    r.twist_covariance.setConstant(0.5);
    r.twist_covariance.diagonal().setConstant(0.1);  // correlations of 5
    external.take(r, s);
  }
  EXPECT_EQ(count(Verdict::kUsed), 50U);
  EXPECT_EQ(external.counters().covariances_left, 50U);
  (void)tracked_at(0s);
  EXPECT_TRUE(tracked_at(900ms).path_covariance.isZero());
}

// As diff_drive says that it knows nothing of height and tilt.
TEST_F(Followed, AnAxisOfWhichNothingIsKnownLeavesTheOthersAsTheyAre) {
  double x = 0.0;
  for (Stamp s = 0s; s < 2s; s += 20ms, x += 0.01) {
    OdometryReport r = report_at(s, x);
    r.twist_covariance.diagonal() << 1e-4, 1e-4, 1e6, 1e6, 1e6, 1e-4;
    external.take(r, s);
  }
  (void)tracked_at(0s);
  const Matrix6d path = tracked_at(1900ms).path_covariance - tracked_at(1880ms).path_covariance;
  // A camera above the base goes ahead when that tilts: ahead is known where the tilt is seen.
  EXPECT_GT(path.inverse()(2, 2), 1e6) << "ahead";
  EXPECT_GT(path(1, 1), 0.1) << "up";
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen{path};
  EXPECT_GT(eigen.eigenvalues()[0], -1e-9);
}

}  // namespace
}  // namespace maplet::daemon
