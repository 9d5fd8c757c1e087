// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <compare>
#include <cstdint>

#include "core/base/clock.hpp"
#include "core/base/static_vector.hpp"
#include "core/geometry/plane.hpp"
#include "core/geometry/se3.hpp"
#include "core/limits.hpp"

namespace maplet {

/// Which maplet, of all agents and all their lives.
struct MapletKey {
  std::uint16_t agent = 0;
  std::uint32_t epoch = 0;  ///< one life of the agent (docs/records.md)
  std::uint32_t id = 0;     ///< counts up from 0 in one epoch

  friend auto operator<=>(const MapletKey&, const MapletKey&) = default;
};

}  // namespace maplet
