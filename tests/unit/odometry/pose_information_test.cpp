// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/odometry/pose_information.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <random>
#include <vector>

#include "core/odometry/running_ratio.hpp"
#include "core/odometry/sym3.hpp"

namespace maplet {
namespace {

const Vector6d kScale = Vector6d::Constant(0.05);

Matrix6d claimed() {
  Matrix6d root = Matrix6d::Random();
  return 1e5 * (root * root.transpose() + 0.5 * Matrix6d::Identity());
}

// Scores whose sum has `factor` times the claimed information, spread over all regions.
ScoreBlocks scores(const Matrix6d& information, double factor, std::mt19937& rng) {
  ScoreBlocks blocks;
  const Matrix6d root = information.llt().matrixL();
  std::normal_distribution<double> normal;
  constexpr int kBlocks = ScoreBlocks::kColumns * ScoreBlocks::kRows;
  for (int i = 0; i < kBlocks; ++i) {
    Vector6d unit;
    for (int k = 0; k < 6; ++k) unit[k] = normal(rng);
    blocks.add(static_cast<std::size_t>(i), std::sqrt(factor / kBlocks) * (root * unit));
  }
  return blocks;
}

TEST(ScoreBlocks, LeaveAClaimThatIsRight) {
  std::mt19937 rng{3};
  const Matrix6d information = claimed();
  double mean = 0.0;
  for (int i = 0; i < 200; ++i) {
    const Matrix6d out = scores(information, 1.0, rng).calibrate(information, kScale);
    mean += (information * out.inverse()).trace() / 6.0 / 200.0;
  }
  EXPECT_NEAR(mean, 24.0 / 18.0, 0.3);  // of few regions
}

TEST(ScoreBlocks, TakeAwayWhatTheRegionsDisagreeAbout) {
  std::mt19937 rng{4};
  const Matrix6d information = claimed();
  const Matrix6d one = scores(information, 1.0, rng).calibrate(information, kScale);
  rng.seed(4);
  const Matrix6d nine = scores(information, 9.0, rng).calibrate(information, kScale);
  EXPECT_NEAR(one.trace() / nine.trace(), 9.0, 1.0);
  rng.seed(4);
  EXPECT_NEAR(scores(information, 9.0, rng).inflation(information, kScale), 12.0, 4.0);
}

TEST(ScoreBlocks, KeepTheNullSpaceOfTheClaim) {
  std::mt19937 rng{5};
  const Vector6d axis = Vector6d::Unit(2);
  const Matrix6d kept = Matrix6d::Identity() - axis * axis.transpose();
  const Matrix6d information = kept * claimed() * kept;
  const Matrix6d out = scores(claimed(), 1.0, rng).calibrate(information, kScale);
  EXPECT_LT(std::abs(axis.dot(out * axis)), 1e-6 * out.trace());
}

// Errors of a fit to t-distributed residuals, squared over what the regions say, per degree of
// freedom. Information: the sum of the weights, as the alignment has it.
double squared_over_claim(double yield, std::mt19937& rng) {
  constexpr double kNu = 5.0;
  constexpr int kResiduals = 480;
  std::normal_distribution<double> normal;
  std::student_t_distribution<double> tail{kNu};
  std::vector<Vector6d> J(kResiduals);
  std::vector<double> noise(kResiduals);
  for (int i = 0; i < kResiduals; ++i) {
    for (int k = 0; k < 6; ++k) J[i][k] = 1e3 * normal(rng);
    noise[i] = tail(rng);
  }
  Vector6d off = Vector6d::Zero();
  Matrix6d information;
  ScoreBlocks blocks;
  for (int round = 0; round < 30; ++round) {
    information.setZero();
    blocks.clear();
    Vector6d gradient = Vector6d::Zero();
    for (int i = 0; i < kResiduals; ++i) {
      const double r = noise[i] - J[i].dot(off);
      const double w = (kNu + 1.0) / (kNu + r * r);
      information += w * J[i] * J[i].transpose();
      gradient += w * r * J[i];
      blocks.add(static_cast<std::size_t>(i % 24), w * r * J[i], yield);
    }
    off += information.inverse() * gradient;
  }
  return off.dot(blocks.calibrate(information, kScale) * off) / 6.0;
}

TEST(ScoreBlocks, KnowThatWeightsFallAsResidualsGrow) {
  constexpr int kDraws = 300;
  std::mt19937 rng{6};
  double nees = 0.0;
  for (int i = 0; i < kDraws; ++i) nees += squared_over_claim(2.0 / 6.0, rng) / kDraws;
  EXPECT_NEAR(nees, 1.0, 0.2);
  rng.seed(6);
  double as_if_they_stayed = 0.0;
  for (int i = 0; i < kDraws; ++i) as_if_they_stayed += squared_over_claim(0.0, rng) / kDraws;
  EXPECT_GT(as_if_they_stayed, 1.4);
}

TEST(RunningRatio, BeginsAtOneAndFollowsWhatIsSeen) {
  RunningRatio ratio{50.0, 6.0};
  EXPECT_DOUBLE_EQ(ratio.value(), 1.0);
  for (int i = 0; i < 500; ++i) ratio.add(4.0, 1.0);
  EXPECT_NEAR(ratio.value(), 4.0, 0.4);
  for (int i = 0; i < 500; ++i) ratio.add(1.0, 1.0);
  EXPECT_NEAR(ratio.value(), 1.0, 0.1);
}

TEST(RunningRatio, KeepsWhatItBeganWithUntilSomethingIsSeen) {
  RunningRatio ratio{50.0, 6.0, 4.0};
  for (int i = 0; i < 100; ++i) ratio.add(0.0, 0.0);
  EXPECT_DOUBLE_EQ(ratio.value(), 4.0);
  for (int i = 0; i < 200; ++i) ratio.add(1.0, 1.0);
  EXPECT_NEAR(ratio.value(), 1.0, 0.1);
}

TEST(Sym3, AgreesWithFullMatrices) {
  const Eigen::Matrix3d root = Eigen::Matrix3d::Random();
  const Eigen::Matrix3d full = root * root.transpose() + Eigen::Matrix3d::Identity();
  const Sym3 sym = Sym3::of(full);
  const Eigen::Matrix3d A = Eigen::Matrix3d::Random();
  const Eigen::Vector3d g = Eigen::Vector3d::Random();
  EXPECT_LT((sym.inverse().matrix() - full.inverse()).norm(), 1e-12);
  EXPECT_LT((congruence(A, sym).matrix() - A * full * A.transpose()).norm(), 1e-12);
  const Eigen::Matrix3d cross = skew(g);
  EXPECT_LT((cross_congruence(g, sym).matrix() - cross.transpose() * full * cross).norm(), 1e-12);
}

}  // namespace
}  // namespace maplet
