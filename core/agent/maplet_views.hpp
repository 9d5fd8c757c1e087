// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "core/agent/maplet_store.hpp"
#include "core/base/arena.hpp"
#include "core/maplet/maplet.hpp"
#include "core/odometry/keyframe.hpp"
#include "core/odometry/view_source.hpp"

namespace maplet {

/// What the camera saw where it made its maplets, drawn from their planes: for an odometry that has
/// lost its view and holds no keyframe of it any more.
///
/// Memory   fixed, from the arena: kViews places and a decoded maplet. When it is full the oldest
///   goes.
/// Time     at() O(1); draw() decodes the maplet unless it was the last one
/// Threads  one caller
class MapletViews final : public ViewSource {
 public:
  static constexpr std::size_t kViews = 1024;

  MapletViews(const MapletStore& store, Arena& arena);

  /// A keyframe was made: maplets are put where the odometry had it.
  void saw(const Keyframe& keyframe) noexcept;
  /// A maplet was put into the store, made of keyframes seen before.
  void add(const Maplet& maplet) noexcept;

  /// Where the odometry had a maplet's origin; nothing when that is forgotten. O(views)
  [[nodiscard]] std::optional<StoredView> origin_of(const MapletKey& key) const noexcept;

  [[nodiscard]] std::size_t count() const noexcept override { return count_; }
  [[nodiscard]] StoredView at(std::size_t index) const noexcept override {
    return views_[index].stored;
  }
  [[nodiscard]] bool draw(std::size_t index, const CameraModel& camera,
                          PatchSet& out) noexcept override;

 private:
  struct Seen {  // a keyframe
    Stamp stamp{};
    StoredView stored;
  };
  struct View {
    StoredView stored;
    MapletKey maplet;
    std::uint8_t keyframe = 0;
  };
  static constexpr std::size_t kSeen = 2 * kMaxMapletKeyframes;

  const MapletStore& store_;
  std::span<View> views_;  ///< a ring
  std::size_t next_ = 0;
  std::size_t count_ = 0;
  std::array<Seen, kSeen> seen_{};  ///< a ring
  std::size_t seen_count_ = 0;
  Arena::Owned<Maplet> decoded_;
  bool any_decoded_ = false;
};

}  // namespace maplet
