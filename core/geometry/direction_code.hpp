// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace maplet {

/// A unit vector in two times 16 bits: the octahedral map (Meyer et al. 2010). Off by up to 6.6e-5
/// rad; axes are exact.
[[nodiscard]] std::uint32_t pack_direction(const Eigen::Vector3d& n) noexcept;
[[nodiscard]] Eigen::Vector3d unpack_direction(std::uint32_t code) noexcept;

}  // namespace maplet
