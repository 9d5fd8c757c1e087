// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>

namespace maplet::codec {

/// A rotation in 56 bits: which component is largest, the others in 18 bits each.
[[nodiscard]] std::uint64_t pack_rotation(const Eigen::Quaterniond& q) noexcept;
/// @return false when the bits are no rotation
[[nodiscard]] bool unpack_rotation(std::uint64_t code, Eigen::Quaterniond& q) noexcept;

/// A covariance as three logarithms of standard deviations, rounded up, and three correlations,
/// rounded to 0: 6 bytes.
struct PackedCovariance {
  std::uint8_t log_sigma[3];
  std::int8_t correlation[3];  ///< 01, 02, 12
};
[[nodiscard]] PackedCovariance pack_covariance(const Eigen::Matrix3d& covariance) noexcept;
/// @return false when the correlations contradict each other
[[nodiscard]] bool unpack_covariance(const PackedCovariance& packed,
                                     Eigen::Matrix3d& covariance) noexcept;

}  // namespace maplet::codec
