// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "core/skeleton/map_odom.hpp"
#include "core/skeleton/skeleton.hpp"

namespace maplet {

/// Where odometry's frame stands in the map: it hangs from this agent's newest maplet, wherever the
/// skeleton moves that. What steers a robot follows odometry and never jumps; what plans adds this.
///
/// Memory   fixed, inside the object. Time O(1). Threads one.
/// Math     docs/math/skeleton.md, eq. 27.
class MapFrame {
 public:
  /// What programs outside are told.
  struct Notice {
    MapletKey map;                ///< whose world: the gauge of the group
    Se3 T_map_odom;               ///< identity before the first maplet
    std::uint64_t jumps = 0;      ///< more than a controller should follow
    std::uint64_t other_map = 0;  ///< of these, changes to another group's world
  };

  /// A maplet of ours came into the skeleton. @param T_odom_maplet  where odometry had it
  void hang_from(const MapletKey& key, const Se3& T_odom_maplet) noexcept {
    key_ = key;
    T_maplet_odom_ = T_odom_maplet.inverse();
  }
  /// To call each frame. @param T_odom_body  by odometry alone
  void update(const Skeleton& skeleton, const Se3& T_odom_body) noexcept {
    const Se3* T_map_maplet = key_ ? skeleton.pose(*key_) : nullptr;
    if (T_map_maplet == nullptr) return;  // none yet, or contracted: until the next one
    const MapletKey map = skeleton.gauge(*key_);
    if (map_ && *map_ != map) ++other_map_;
    map_ = map;
    (void)frame_.update(*T_map_maplet * T_maplet_odom_ * T_odom_body, T_odom_body);
  }
  [[nodiscard]] Notice notice() const noexcept {
    return {map_.value_or(MapletKey{}), frame_.T_map_odom(), frame_.jumps(), other_map_};
  }

 private:
  std::optional<MapletKey> key_;
  std::optional<MapletKey> map_;
  Se3 T_maplet_odom_;
  MapOdom frame_;
  std::uint64_t other_map_ = 0;
};

}  // namespace maplet
