// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/base/clock.hpp"
#include "core/maplet/maplet.hpp"

namespace maplet {

/// A distance between the origins of two maplets of two agents.
struct MapletRange {
  MapletKey a;  ///< of the agent that measured
  MapletKey b;  ///< of the other
  Stamp stamp{};
  double range_m = 0.0;
  double sigma_m = 0.0;
};

}  // namespace maplet
