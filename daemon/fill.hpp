// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>

namespace maplet::daemon {

/// How full a store of fixed size is: now, and when it was fullest of the seconds looked at.
struct Fill {
  std::uint64_t used = 0;
  std::uint64_t peak = 0;
  std::uint64_t capacity = 0;

  void note(std::uint64_t now, std::uint64_t of) noexcept {
    used = now;
    peak = std::max(peak, now);
    capacity = of;
  }
};

/// The stores that a mission fills.
struct Fills {
  Fill own_maplets, nodes, factors;
};

}  // namespace maplet::daemon
