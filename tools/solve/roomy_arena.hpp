// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <new>

#include "core/base/arena.hpp"

namespace maplet::graphs {

/// An arena of `most` bytes of address space, or of what the system lets one have of it.
/// @throws std::bad_alloc when that is next to nothing
[[nodiscard]] inline std::unique_ptr<Arena> roomy_arena(std::uint64_t most) {
  constexpr std::uint64_t kLeast = std::uint64_t{1} << 26;
  for (;; most /= 2) {
    try {
      return std::make_unique<Arena>(most);
    } catch (const std::bad_alloc&) {
      if (most <= kLeast) throw;
    }
  }
}

}  // namespace maplet::graphs
