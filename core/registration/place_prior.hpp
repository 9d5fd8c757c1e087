// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/maplet/maplet.hpp"
#include "core/registration/delta_pose.hpp"
#include "core/registration/region.hpp"

namespace maplet {

/// Older maplets of this agent, and where the skeleton puts them. The agent implements it.
class PlacePrior {
 public:
  virtual ~PlacePrior() = default;

  /// Maplets that may be asked for, the oldest first.
  [[nodiscard]] virtual int count() const noexcept = 0;
  [[nodiscard]] virtual MapletKey key(int index) const noexcept = 0;
  /// @return false when nothing relates the two
  [[nodiscard]] virtual bool relate(int index, const MapletKey& newest,
                                    Transform<MapletA, MapletB>& T_index_newest) const noexcept = 0;
  /// Nothing but the path relates the two: the skeleton has no way from one to the other.
  [[nodiscard]] virtual bool apart(int, const MapletKey&) const noexcept { return false; }
  /// @return the maplet, valid until the next call, or nullptr when it is not kept any more
  [[nodiscard]] virtual const Maplet* load(int index) noexcept = 0;
  /// The region around its frontier, its own frame: where a registration with it has to look.
  /// @return nullptr when it has no border in the open, or nobody looked
  [[nodiscard]] virtual const RegionOfInterest* frontier(int) const noexcept { return nullptr; }
};

}  // namespace maplet
