// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>

#include "core/maplet/maplet.hpp"
#include "core/skeleton/skeleton.hpp"

namespace maplet {

/// Where the overlay finds maplets by their key.
class MapletLookup {
 public:
  virtual ~MapletLookup() = default;
  /// @return nullptr when it is not held here
  [[nodiscard]] virtual const Maplet* find(const MapletKey& key) noexcept = 0;
};

/// A plane of a maplet, where the skeleton puts it.
struct PlacedPlane {
  const Maplet& maplet;
  const MapletPlane& part;  ///< its cells and basis are in the maplet's frame
  Plane plane;              ///< in the world
  const Se3& T_world_maplet;
};

/// What an overlay showed.
struct Overlay {
  int maplets = 0;
  int missing = 0;  ///< placed, but not held here
  int planes = 0;
  double area_m2 = 0.0;
};

/// Lays maplets over the skeleton: one map in the world of a group, at a chosen fidelity (the
/// paper: maplets are overlaid on the skeleton, as many and as fine as the task wants).
///
/// Memory   none.
/// Time     O(nodes + planes shown).
/// @param gauge     the group to show
/// @param fidelity  share of each maplet's area that its largest planes must make up, 0..1
/// @param first, count  of the skeleton's nodes: a part of the map at a time
template <class Show>
Overlay lay_over(const Skeleton& skeleton, const MapletKey& gauge, MapletLookup& maplets,
                 double fidelity, Show&& show, int first = 0,
                 int count = std::numeric_limits<int>::max()) noexcept {
  Overlay out;
  for (int i = first; i < skeleton.node_count() && i - first < count; ++i) {
    const Skeleton::NodeView node = skeleton.node(i);
    if (node.gauge != gauge) continue;
    const Maplet* maplet = maplets.find(node.key);
    if (maplet == nullptr) {
      ++out.missing;
      continue;
    }
    ++out.maplets;
    double whole = 0.0;
    for (const MapletPlane& p : maplet->planes) whole += p.area_m2;
    double shown = 0.0;
    for (const MapletPlane& p : maplet->planes) {  // the largest first
      if (!(shown < fidelity * whole)) break;
      show(PlacedPlane{*maplet, p, node.T_world_maplet * p.plane, node.T_world_maplet});
      shown += p.area_m2;
      ++out.planes;
    }
    out.area_m2 += shown;
  }
  return out;
}

}  // namespace maplet
