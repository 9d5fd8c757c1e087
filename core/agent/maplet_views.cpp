// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/agent/maplet_views.hpp"

#include <algorithm>

#include "core/agent/maplet_drawing.hpp"
#include "core/maplet/codec.hpp"

namespace maplet {

MapletViews::MapletViews(const MapletStore& store, Arena& arena)
    : store_{store},
      views_{arena.make_array<View>(kViews, "agent/maplet views")},
      decoded_{arena.make<Maplet>("agent/viewed maplet")} {}

void MapletViews::saw(const Keyframe& keyframe) noexcept {
  seen_[seen_count_++ % kSeen] = {keyframe.stamp, {keyframe.T_odom_camera.se3, keyframe.segment}};
}

void MapletViews::add(const Maplet& maplet) noexcept {
  const auto origin = std::find_if(seen_.begin(), seen_.begin() + std::min(seen_count_, kSeen),
                                   [&](const Seen& s) { return s.stamp == maplet.stamp; });
  if (origin == seen_.begin() + std::min(seen_count_, kSeen)) return;
  for (std::size_t k = 0; k < maplet.keyframes.size(); ++k) {
    const Se3 T_odom_view = origin->stored.T_odom_view * maplet.keyframes[k].T_maplet_camera.se3;
    views_[next_] = {
        {T_odom_view, origin->stored.segment}, maplet.key, static_cast<std::uint8_t>(k)};
    next_ = (next_ + 1) % kViews;
    count_ = std::min(count_ + 1, kViews);
  }
}

std::optional<StoredView> MapletViews::origin_of(const MapletKey& key) const noexcept {
  const auto views = views_.first(count_);
  const auto view = std::find_if(views.begin(), views.end(),
                                 [&](const View& v) { return v.keyframe == 0 && v.maplet == key; });
  if (view == views.end()) return {};
  return view->stored;
}

bool MapletViews::draw(std::size_t index, const CameraModel& camera, PatchSet& out) noexcept {
  const View& view = views_[index];
  if (!any_decoded_ || decoded_->key != view.maplet) {
    const auto bytes = store_.find(view.maplet);
    any_decoded_ = bytes && decode(*bytes, *decoded_);
    if (!any_decoded_) return false;
  }
  if (view.keyframe >= decoded_->keyframes.size()) return false;
  draw_maplet(*decoded_, decoded_->keyframes[view.keyframe].T_maplet_camera.se3, camera, out);
  return !out.patches.empty();
}

}  // namespace maplet
