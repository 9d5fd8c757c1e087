// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/odometry/keyframe_pool.hpp"

#include <algorithm>
#include <limits>

namespace maplet {

namespace {

constexpr double kMinSharedView = 0.4;
constexpr double kMetresPerRadian = 1.5;  // a turn by 1 rad changes a view like this way

double view_distance(const Se3& a, const Se3& b) noexcept {
  const Se3 between = a.inverse() * b;
  return between.t.norm() + kMetresPerRadian * between.angle();
}

}  // namespace

KeyframePool::KeyframePool(const OdometryConfig& config, Arena& arena)
    : config_{config}, newest_keyframe_{arena.make<Keyframe>("odometry/keyframe")} {
  for (auto& slot : slots_) slot = arena.make<Slot>("odometry/view", facets_of(config), arena);
}

const Keyframe& KeyframePool::commit(const PatchView& frame) noexcept {
  const Keyframe& keyframe = *newest_keyframe_;
  newest_ = used_ < kSlots ? used_ : least_worth(keyframe.T_odom_camera.se3);
  Slot& slot = *slots_[newest_];
  slot.place = {keyframe.id, keyframe.segment, keyframe.T_odom_camera.se3};
  slot.view.assign(keyframe.patches, config_);
  const std::size_t same = std::min(slot.view.facets().size(), frame.facets().size());
  for (std::size_t i = 0; i < same; ++i) {
    slot.view.facets()[i].moved = frame.facets()[i].moved;
    slot.view.facets()[i].fresh = frame.facets()[i].fresh;
  }
  used_ = std::max(used_, newest_ + 1);
  return keyframe;
}

// Half of the slots hold the nearest views; of the far ones the farthest goes first.
std::size_t KeyframePool::least_worth(const Se3& T_odom_camera) const noexcept {
  std::size_t worst = newest_;
  double worst_distance = -1.0;
  for (std::size_t i = 0; i < used_; ++i) {
    if (i == newest_) continue;
    const double distance = view_distance(place(i).T_odom_camera, T_odom_camera);
    if (distance > worst_distance) {
      worst = i;
      worst_distance = distance;
    }
  }
  return worst;
}

KeyframePool::References KeyframePool::references(const PatchView& frame,
                                                  const Se3& T_odom_camera) const noexcept {
  References out;
  out.push_back(reference(newest_));
  std::array<std::size_t, kSlots> older{};
  std::size_t count = 0;
  for (std::size_t i = 0; i < used_; ++i) {
    if (i == newest_ || place(i).segment != newest().segment) continue;
    const Se3 T_slot_camera = place(i).T_odom_camera.inverse() * T_odom_camera;
    if (frame.share_on(slots_[i]->view, T_slot_camera) >= kMinSharedView) older[count++] = i;
  }
  std::sort(older.begin(), older.begin() + count,
            [&](std::size_t a, std::size_t b) { return place(a).id < place(b).id; });
  for (std::size_t i = 0; i < count; ++i) {
    if (out.size() == static_cast<std::size_t>(config_.references)) break;
    out.push_back(reference(older[i]));
  }
  return out;
}

}  // namespace maplet
