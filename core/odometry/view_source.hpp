// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/geometry/se3.hpp"
#include "core/patches/patch.hpp"

namespace maplet {

/// From where something was seen that others keep.
struct StoredView {
  Se3 T_odom_view;
  std::uint32_t segment = 0;
};

/// Views that can still be drawn when the keyframes that saw them are gone: of the maplets' planes.
/// The odometry declares it, agent/ fills it in.
class ViewSource {
 public:
  virtual ~ViewSource() = default;

  [[nodiscard]] virtual std::size_t count() const noexcept = 0;
  /// Time O(1)
  [[nodiscard]] virtual StoredView at(std::size_t index) const noexcept = 0;
  /// The patches that `camera` would have from there.
  /// @return false when what it showed is no longer kept
  [[nodiscard]] virtual bool draw(std::size_t index, const CameraModel& camera,
                                  PatchSet& out) noexcept = 0;
};

}  // namespace maplet
