// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/exchange/covariance_code.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <limits>

#include "tests/support/records.hpp"

namespace maplet {
namespace {

/// How far the decoded covariance is from the true one, seen in the true one's own units.
double whitened_error(const Matrix6d& truth, const Matrix6d& decoded) {
  const Matrix6d L_inverse = truth.llt().matrixL().toDenseMatrix().inverse();
  return (L_inverse * decoded * L_inverse.transpose() - Matrix6d::Identity()).norm();
}

TEST(CovarianceCode, KeepsCovariance) {
  std::mt19937 rng{1};
  for (int i = 0; i < 500; ++i) {
    const Matrix6d truth = test::random_covariance(rng);
    const auto code = encode_covariance(truth);
    ASSERT_TRUE(code);
    EXPECT_TRUE(valid(*code));
    EXPECT_LT(whitened_error(truth, decode_covariance(*code)), 0.01);
  }
}

TEST(CovarianceCode, KeepsTightDirectionsBesideFreeOne) {
  std::mt19937 rng{2};
  for (const double free_sigma : {0.1, 0.3}) {  // 100 and 300 times the tight ones
    for (int i = 0; i < 500; ++i) {
      const Matrix6d truth = test::random_covariance(rng, free_sigma);
      const auto code = encode_covariance(truth);
      ASSERT_TRUE(code);
      EXPECT_LT(whitened_error(truth, decode_covariance(*code)), 0.5) << free_sigma;
    }
  }
}

TEST(CovarianceCode, NeverClaimsToKnowMuchMore) {
  std::mt19937 rng{6};
  for (const double free_sigma : {1.0, 10.0, 1000.0}) {
    for (int i = 0; i < 200; ++i) {
      const Matrix6d truth = test::random_covariance(rng, free_sigma);
      const auto code = encode_covariance(truth);
      ASSERT_TRUE(code);
      const Matrix6d L_inverse = truth.llt().matrixL().toDenseMatrix().inverse();
      const Matrix6d white = L_inverse * decode_covariance(*code) * L_inverse.transpose();
      const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen{white};
      EXPECT_GT(eigen.eigenvalues().minCoeff(), 0.7) << free_sigma;
    }
  }
}

TEST(CovarianceCode, DecodesToSymmetricPositiveDefinite) {
  std::mt19937 rng{3};
  for (int i = 0; i < 500; ++i) {
    Matrix6d any = test::random_covariance(rng, 10.0);
    any(2, 1) *= 1.5;  // no longer a covariance
    any(1, 2) *= 1.5;
    const auto code = encode_covariance(any);
    ASSERT_TRUE(code);
    const Matrix6d decoded = decode_covariance(*code);
    EXPECT_EQ(decoded, decoded.transpose().eval());
    // Scaled to correlations, where the smallest pivot is 2^-12.
    const Vector6d s = decoded.diagonal().cwiseSqrt().cwiseInverse();
    const Matrix6d correlation = s.asDiagonal() * decoded * s.asDiagonal();
    EXPECT_EQ(Eigen::LLT<Matrix6d>{correlation}.info(), Eigen::Success);
  }
}

TEST(CovarianceCode, ClampsWhatIsBeyondItsRange) {
  Matrix6d any = Matrix6d::Identity();
  any(0, 0) = 0.0;
  any(1, 1) = 1e300;
  const auto code = encode_covariance(any);
  ASSERT_TRUE(code);
  EXPECT_EQ(code->sigma[0], CovarianceCode::kSigmaMin);
  EXPECT_EQ(code->sigma[1], CovarianceCode::kSigmaMax);
  EXPECT_TRUE(valid(*code));
}

TEST(CovarianceCode, RefusesNonsense) {
  Matrix6d any = Matrix6d::Identity();
  any(3, 2) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(encode_covariance(any));
  any = Matrix6d::Identity();
  any(5, 5) = -1e-9;
  EXPECT_FALSE(encode_covariance(any));
}

TEST(CovarianceCode, KnowsForeignCodes) {
  const auto good = encode_covariance(Matrix6d::Identity());
  ASSERT_TRUE(good);
  auto bad = *good;
  bad.sigma[2] = 0.0F;
  EXPECT_FALSE(valid(bad));
  bad = *good;
  bad.sigma[2] = 1.00001F;  // more digits than the code has
  EXPECT_FALSE(valid(bad));
  bad = *good;
  bad.sigma[0] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_FALSE(valid(bad));
  bad = *good;
  bad.shape[4] = std::numeric_limits<std::int16_t>::min();
  EXPECT_FALSE(valid(bad));
  bad = *good;
  bad.pivot[0] = 65535;
  EXPECT_FALSE(valid(bad));
}

}  // namespace
}  // namespace maplet
