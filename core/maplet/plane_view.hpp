// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "core/maplet/plane_map.hpp"

namespace maplet {

inline constexpr double kBehindPlane_m = 0.05;  ///< a camera nearer than that sees no front

/// One keyframe while it is added to a PlaneMap.
struct PlaneMap::View {
  const PatchSet& set;
  const Se3 T_maplet_camera;
  const Se3 T_camera_maplet;
  const Matrix6d& covariance;
  std::span<const std::uint16_t> order;
  std::span<const std::uint16_t> first_of;

  [[nodiscard]] std::span<const std::uint16_t> patches_of(std::size_t frame_plane) const noexcept {
    return order.subspan(first_of[frame_plane], first_of[frame_plane + 1] - first_of[frame_plane]);
  }
};

}  // namespace maplet
