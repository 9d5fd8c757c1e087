// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>

namespace maplet::test {

/// How many times longer than on a processor a wall clock's limit is: under an emulator ctest sets
/// MAPLET_PATIENCE.
inline int patience() {
  const char* set = std::getenv("MAPLET_PATIENCE");
  return set != nullptr ? std::atoi(set) : 1;
}

}  // namespace maplet::test
