// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "core/base/static_vector.hpp"
#include "core/geometry/se3.hpp"

namespace maplet {

/// Which directions of a pose the evidence knows, in units of what counts as known.
struct KnownDirections {
  Matrix6d information = Matrix6d::Zero();  ///< of the directions kept; singular
  Vector6d gradient = Vector6d::Zero();     ///< the same
  Matrix6d pin = Matrix6d::Zero();          ///< holds the free directions to the prior
  StaticVector<Vector6d, 6> free_axes;      ///< unit tangents
};

/// Drops the directions that are known worse than `scale`, or only through noise of normals.
///
/// @param spurious  information that noise of normals would make up (eq. 7)
/// Math   docs/math/odometry.md, eq. 6-7
[[nodiscard]] KnownDirections known_directions(const Matrix6d& information,
                                               const Vector6d& gradient, const Matrix6d& spurious,
                                               const Vector6d& scale) noexcept;

/// The eigenbasis of what is claimed: scores in it have unit variance where the claim is right.
struct Whitening {
  Matrix6d basis = Matrix6d::Zero();  ///< columns: eigenvector / sqrt(eigenvalue), kept ones first
  int kept = 0;

  Whitening(const Matrix6d& claimed, const Vector6d& scale) noexcept;
};

/// The scores (derivatives of the log-likelihood by the pose) of the evidence, summed by region of
/// the image. At the optimum their sum vanishes; how far the regions pull apart tells how much the
/// evidence is worth, distortion and shared error included.
///
/// Memory   inside the object.
/// Math     docs/math/odometry.md, eq. 13-15: a cluster-robust ("sandwich") covariance.
class ScoreBlocks {
 public:
  static constexpr int kColumns = 6;
  static constexpr int kRows = 4;

  void clear() noexcept { *this = ScoreBlocks{}; }
  /// @param yield  of what the score claims, the share that its residual takes back as it grows and
  ///   its weight falls: 2 / (nu + its dimension) where it is t-distributed, 0 where weights stay;
  ///   times whatever the score was divided by
  void add(std::size_t block, const Vector6d& score, double yield = 0.0) noexcept {
    sums_[block] += score;
    used_[block] = true;
    if (yield > 0.0) yielded_.selfadjointView<Eigen::Lower>().rankUpdate(score, yield);
  }
  /// The information that the regions' disagreement leaves of `claimed` (may be singular: its null
  /// space is kept).
  [[nodiscard]] Matrix6d calibrate(const Matrix6d& claimed, const Vector6d& scale) const noexcept;
  /// Mean variance of the scores over what `claimed` says: 1 when the claim is right.
  [[nodiscard]] double inflation(const Matrix6d& claimed, const Vector6d& scale) const noexcept;

 private:
  std::array<Vector6d, kColumns* kRows> sums_ = zeros();
  std::array<bool, kColumns * kRows> used_{};
  Matrix6d yielded_ = Matrix6d::Zero();  ///< lower triangle; eq. 14a

  static std::array<Vector6d, kColumns * kRows> zeros() noexcept {
    std::array<Vector6d, kColumns * kRows> out;
    out.fill(Vector6d::Zero());
    return out;
  }
};

/// The standard deviation along the least known axis of the frame.
[[nodiscard]] inline double largest_sigma(const Eigen::Matrix3d& covariance) noexcept {
  return std::sqrt(std::max(0.0, covariance.diagonal().maxCoeff()));
}

/// The block of a pixel.
[[nodiscard]] inline std::uint8_t score_block(double u_px, double v_px, int width_px,
                                              int height_px) noexcept {
  const int column = static_cast<int>(u_px * ScoreBlocks::kColumns / width_px);
  const int row = static_cast<int>(v_px * ScoreBlocks::kRows / height_px);
  const int i = column < 0                        ? 0
                : column >= ScoreBlocks::kColumns ? ScoreBlocks::kColumns - 1
                                                  : column;
  const int j = row < 0 ? 0 : row >= ScoreBlocks::kRows ? ScoreBlocks::kRows - 1 : row;
  return static_cast<std::uint8_t>(j * ScoreBlocks::kColumns + i);
}

}  // namespace maplet
