// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/base/clock.hpp"
#include "core/maplet/maplet.hpp"

namespace maplet {

/// An encoded maplet and what one wants to know before decoding it.
///
/// Memory   a view: the bytes are the giver's, valid for the duration of a call.
struct MapletRecord {
  MapletKey key;
  Stamp stamp{};  ///< of the origin keyframe
  std::uint16_t planes = 0;
  std::uint16_t keyframes = 0;
  std::span<const std::byte> bytes;
};

}  // namespace maplet
