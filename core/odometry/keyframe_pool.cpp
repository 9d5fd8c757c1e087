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

KeyframePool::KeyframePool(const OdometryConfig& config, Arena& arena) : config_{config} {
  for (auto& slot : slots_) slot = arena.make<Slot>("odometry/keyframe", arena);
}

Keyframe& KeyframePool::begin_add(const Se3& T_odom_camera) noexcept {
  filling_ = used_ < kSlots ? used_ : least_worth(T_odom_camera);
  return slots_[filling_]->keyframe;
}

const Keyframe& KeyframePool::commit() noexcept {
  Slot& slot = *slots_[filling_];
  slot.view.assign(slot.keyframe.patches, config_);
  newest_ = filling_;
  used_ = std::max(used_, filling_ + 1);
  return slot.keyframe;
}

// Half of the slots hold the nearest views; of the far ones the farthest goes first.
std::size_t KeyframePool::least_worth(const Se3& T_odom_camera) const noexcept {
  std::size_t worst = newest_;
  double worst_distance = -1.0;
  for (std::size_t i = 0; i < used_; ++i) {
    if (i == newest_) continue;
    const double distance = view_distance(keyframe(i).T_odom_camera.se3, T_odom_camera);
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
    if (i == newest_ || keyframe(i).segment != newest().segment) continue;
    const Se3 T_slot_camera = keyframe(i).T_odom_camera.se3.inverse() * T_odom_camera;
    if (frame.share_on(slots_[i]->view, T_slot_camera) >= kMinSharedView) older[count++] = i;
  }
  std::sort(older.begin(), older.begin() + count,
            [&](std::size_t a, std::size_t b) { return keyframe(a).id < keyframe(b).id; });
  for (std::size_t i = 0; i < count; ++i) {
    if (out.size() == static_cast<std::size_t>(config_.references)) break;
    out.push_back(reference(older[i]));
  }
  return out;
}

}  // namespace maplet
