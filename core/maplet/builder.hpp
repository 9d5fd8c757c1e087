// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/base/deadline.hpp"
#include "core/maplet/config.hpp"
#include "core/maplet/cut_rule.hpp"
#include "core/maplet/maplet.hpp"
#include "core/maplet/plane_map.hpp"
#include "core/odometry/keyframe.hpp"

namespace maplet {

/// How a maplet hangs on the one before it, as the odometry knows it.
struct PathLink {
  bool valid = false;  ///< the first maplet has none
  MapletKey previous;
  Stamp stamp_previous{};
  Transform<MapletFrame, MapletFrame> T_previous_this;
  Matrix6d covariance = Matrix6d::Zero();  ///< tangent of this; m^2, rad^2
};

/// A finished maplet.
struct MapletCut {
  Maplet maplet;                     ///< as decoded from `bytes`
  std::span<const std::byte> bytes;  ///< its wire form, at most maplet.max_bytes
  PathLink link;
  CutReason reason = CutReason::kNone;
  std::uint32_t origin_valid_pixels = 0;  ///< of the frame at the origin: the points it replaces
};

/// Fuses keyframes into maplets and decides where one ends and the next begins.
///
/// The next maplet's origin is a keyframe of the one that ends, and the keyframes from there on
/// belong to both: they overlap by construction.
///
/// Memory   arena: a PlaneMap, two maplets, maplet.overlap_keyframes keyframes, the wire form
/// Time     a keyframe's fusion per add; a cut adds the overlap's keyframes once more and the codec
/// Threads  one
/// Math     docs/math/maplet.md (paper: Algorithm 1)
class MapletBuilder {
 public:
  MapletBuilder(const MapletConfig& config, Arena& arena);

  /// Whose maplets these are; ids count up from `first_id`. Before the first add.
  void identify(std::uint16_t agent, std::uint32_t epoch, std::uint32_t first_id) noexcept;

  /// @param keyframe  copied where needed
  /// @return the maplet that ended before this keyframe, valid until the next call, or nullptr
  [[nodiscard]] const MapletCut* add(const Keyframe& keyframe, Deadline deadline) noexcept;

  /// Ends the maplet under construction.
  /// @return it, or nullptr when it holds nothing that the one before it does not
  [[nodiscard]] const MapletCut* finish() noexcept;

  [[nodiscard]] const MapletCounts& counts() const noexcept { return map_.counts(); }

 private:
  struct Member {  // a keyframe of the maplet under construction
    Stamp stamp{};
    Se3 T_odom_camera;
    Se3 T_origin_camera;                     // refined against the maplet's planes
    Matrix6d covariance = Matrix6d::Zero();  // of T_origin_this, tangent of this
    std::uint32_t valid_pixels = 0;
  };

  void take(const Keyframe& keyframe, Deadline deadline) noexcept;
  void start(const Keyframe& origin) noexcept;
  void start_overlapping(Deadline deadline) noexcept;
  [[nodiscard]] CutReason due(const Keyframe& keyframe) const noexcept;
  const MapletCut* cut(CutReason reason) noexcept;
  void link_to(const Se3& T_previous_this, const Matrix6d& covariance) noexcept;
  void remember(const Keyframe& keyframe) noexcept;

  MapletConfig config_;
  PlaneMap map_;
  CutRule rule_;
  StaticVector<Member, kMaxMapletKeyframes> members_;
  // A ring: the last keyframes of the current maplet.
  StaticVector<Arena::Owned<Keyframe>, MapletConfig::kMaxOverlapKeyframes> recent_;
  std::size_t recent_count_ = 0;  // ever, in this segment
  std::size_t shared_ = 0;        // members that the maplet before has too
  std::uint32_t segment_ = 0;
  std::uint32_t blind_spells_ = 0;
  MapletKey key_;
  PathLink link_;  // of the maplet under construction
  Arena::Owned<Maplet> draft_;
  Arena::Owned<MapletCut> cut_;
  std::span<std::byte> bytes_;
};

}  // namespace maplet
