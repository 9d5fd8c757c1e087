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
/// Memory   fixed, from the arena: kSlots views, and the newest keyframe with its patches.
/// Time     add(): copies one PatchSet; references(): O(slots).
/// Threads  one caller at a time.
class KeyframePool {
 public:
  static constexpr std::size_t kSlots = 12;

  KeyframePool(const OdometryConfig& config, Arena& arena);

  /// Where each view was taken.
  struct Place {
    std::uint32_t id = 0;
    std::uint32_t segment = 0;
    Se3 T_odom_camera;
  };

  /// The newest keyframe is filled anew; then commit() gives its view a free slot, or that of the
  /// one least worth keeping.
  [[nodiscard]] Keyframe& begin_add() noexcept { return *newest_keyframe_; }
  /// @param frame  the view of the same patches: what of it moves is no reference here either
  const Keyframe& commit(const PatchView& frame) noexcept;

  [[nodiscard]] bool empty() const noexcept { return used_ == 0; }
  [[nodiscard]] std::size_t size() const noexcept { return used_; }
  [[nodiscard]] const Keyframe& newest() const noexcept { return *newest_keyframe_; }
  [[nodiscard]] const Place& place(std::size_t slot) const noexcept { return slots_[slot]->place; }
  [[nodiscard]] Reference reference(std::size_t slot) const noexcept {
    return {&slots_[slot]->view, slots_[slot]->place.T_odom_camera.inverse()};
  }

  /// The newest keyframe, then the oldest ones of its segment that a camera at T_odom_camera shares
  /// enough of its view with.
  using References = StaticVector<Reference, PatchAligner::kMaxReferences>;
  [[nodiscard]] References references(const PatchView& frame,
                                      const Se3& T_odom_camera) const noexcept;

 private:
  struct Slot {
    Slot(std::size_t facets, Arena& arena) : view{facets, arena} {}
    Place place;
    PatchView view;
  };

  [[nodiscard]] std::size_t least_worth(const Se3& T_odom_camera) const noexcept;

  OdometryConfig config_;
  Arena::Owned<Keyframe> newest_keyframe_;
  std::array<Arena::Owned<Slot>, kSlots> slots_;
  std::size_t used_ = 0;
  std::size_t newest_ = 0;
};

}  // namespace maplet
