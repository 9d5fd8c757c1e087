// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/base/static_vector.hpp"
#include "core/odometry/keyframe.hpp"
#include "core/odometry/odometry_config.hpp"
#include "core/odometry/patch_aligner.hpp"
#include "core/odometry/patch_view.hpp"

namespace maplet {

/// The newest keyframe and older ones near it, so that drift stops when the view returns.
///
/// Memory   fixed, from the arena: kSlots keyframes with their views.
/// Time     add(): copies one PatchSet; references(): O(slots).
/// Threads  one caller at a time.
class KeyframePool {
 public:
  static constexpr std::size_t kSlots = 12;

  KeyframePool(const OdometryConfig& config, Arena& arena);

  /// A free slot's keyframe, or that of the one least worth keeping; call commit() once filled.
  [[nodiscard]] Keyframe& begin_add(const Se3& T_odom_camera) noexcept;
  const Keyframe& commit() noexcept;

  [[nodiscard]] bool empty() const noexcept { return used_ == 0; }
  [[nodiscard]] std::size_t size() const noexcept { return used_; }
  [[nodiscard]] const Keyframe& newest() const noexcept { return slots_[newest_]->keyframe; }
  [[nodiscard]] const Keyframe& keyframe(std::size_t slot) const noexcept {
    return slots_[slot]->keyframe;
  }
  [[nodiscard]] Reference reference(std::size_t slot) const noexcept {
    return {&slots_[slot]->view, slots_[slot]->keyframe.T_odom_camera.se3.inverse()};
  }

  /// The newest keyframe, then the oldest ones of its segment that a camera at T_odom_camera shares
  /// enough of its view with.
  using References = StaticVector<Reference, PatchAligner::kMaxReferences>;
  [[nodiscard]] References references(const PatchView& frame,
                                      const Se3& T_odom_camera) const noexcept;

 private:
  struct Slot {
    explicit Slot(Arena& arena) : view{arena} {}
    Keyframe keyframe;
    PatchView view;
  };

  [[nodiscard]] std::size_t least_worth(const Se3& T_odom_camera) const noexcept;

  OdometryConfig config_;
  std::array<Arena::Owned<Slot>, kSlots> slots_;
  std::size_t used_ = 0;
  std::size_t newest_ = 0;
  std::size_t filling_ = 0;
};

}  // namespace maplet
