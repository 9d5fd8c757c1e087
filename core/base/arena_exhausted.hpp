// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>

namespace maplet {

/// The configuration asks for more than the arena reserves. Only while the stages are built; what()
/// says how much that is and which component asked.
class ArenaExhausted : public std::length_error {
 public:
  using std::length_error::length_error;
};

}  // namespace maplet
