// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/maplet/maplet.hpp"
#include "core/registration/place_compare.hpp"
#include "core/registration/place_descriptor.hpp"

namespace maplet {

/// How likely a maplet is to be found again, and to be found in one place only: what is shared
/// first.
///
/// A maplet is compared with itself: what fits it nearly as well after a turn or a shift (a
/// corridor, a symmetric room) fits any copy of it in two places.
///
/// Memory   fixed, inside the object (~25 KB)
/// Time     one PlaceCompare::guess, ~100 us
/// Threads  one caller at a time
/// Math     docs/math/icap.md, eq. 18
class Saliency {
 public:
  /// @return 0 (bare, or like itself elsewhere) .. 1
  [[nodiscard]] double of(const Maplet& maplet) noexcept;

 private:
  PlaceDescriptor place_;
  PlaceCompare compare_;
};

}  // namespace maplet
