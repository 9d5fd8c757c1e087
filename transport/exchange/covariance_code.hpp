// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

#include "core/base/expected.hpp"
#include "core/geometry/se3.hpp"

namespace maplet {

/// A 6x6 covariance in 52 bytes' worth of values that always give back a positive definite matrix.
///
/// The Cholesky factor L with its rows divided by the standard deviations: what is small beside its
/// row keeps a relative precision of its own (pivot), so a tight direction stays tight although
/// another is free.
///
/// Math   docs/math/records.md, eq. 1-3.
struct CovarianceCode {
  /// Standard deviations (m, m, m, rad, rad, rad); eleven significant bits, kSigmaMin..kSigmaMax.
  std::array<float, 6> sigma{};
  std::array<std::int16_t, 15> shape{};  ///< L_ij / sigma_i below the diagonal, of 32000
  std::array<std::uint16_t, 5> pivot{};  ///< -4096 log2(L_ii / sigma_i), rows 1..5

  static constexpr double kSigmaMin = 0x1p-20;
  static constexpr double kSigmaMax = 0x1p12;

  friend bool operator==(const CovarianceCode&, const CovarianceCode&) = default;
};

/// @return kBadInput when a number is not finite or a variance negative. Variances beyond the range
///   of sigma are clamped; a matrix that is not positive definite loses what makes it so.
[[nodiscard]] Expected<CovarianceCode> encode_covariance(const Matrix6d& covariance) noexcept;

/// Symmetric to the last bit, positive definite.
[[nodiscard]] Matrix6d decode_covariance(const CovarianceCode& code) noexcept;

/// False when a code from outside cannot have come from encode_covariance().
[[nodiscard]] bool valid(const CovarianceCode& code) noexcept;

}  // namespace maplet
