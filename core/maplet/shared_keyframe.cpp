// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/maplet/shared_keyframe.hpp"

namespace maplet {

std::optional<Se3> shared_keyframe(const Maplet& a, const Maplet& b) noexcept {
  if (a.key.agent != b.key.agent || a.key.epoch != b.key.epoch) return std::nullopt;
  for (const MapletKeyframe& ka : a.keyframes)
    for (const MapletKeyframe& kb : b.keyframes)
      if (ka.stamp == kb.stamp) return ka.T_maplet_camera.se3 * kb.T_maplet_camera.se3.inverse();
  return std::nullopt;
}

}  // namespace maplet
