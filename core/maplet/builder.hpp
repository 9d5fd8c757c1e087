// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "core/base/arena.hpp"
#include "core/base/deadline.hpp"
#include "core/frame/image_size.hpp"
#include "core/geometry/planar_motion.hpp"
#include "core/maplet/config.hpp"
#include "core/maplet/cut_rule.hpp"
#include "core/maplet/kept_depth.hpp"
#include "core/maplet/maplet.hpp"
#include "core/maplet/path_point.hpp"
#include "core/maplet/plane_map.hpp"
#include "core/maplet/up_finder.hpp"
#include "core/odometry/keyframe.hpp"
#include "core/odometry/track.hpp"

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
  PointShare points;                      ///< of its keyframes
  std::uint32_t origin_valid_pixels = 0;  ///< of the frame at the origin: the points it replaces
  Se3 T_odom_origin;                      ///< where odometry had it
};

/// Fuses keyframes into maplets and decides where one ends and the next begins.
///
/// The next maplet's origin is a keyframe of the one that ends, and the keyframes from there on
/// belong to both: they overlap by construction. Which of the last keyframes it is depends on what
/// is around it: the line from origin to origin goes through the open where it can, and the
/// boundary moves to where there is structure.
///
/// Memory   arena: a PlaneMap, two maplets, maplet.overlap_keyframes + boundary_keyframes
///          keyframes, a KeptDepth for each of maplet.max_keyframes, the wire form
/// Time     a keyframe's fusion per add; a cut adds a look at all cells through all keyframes (it
///          stops at the deadline), the overlap's keyframes once more and the codec
/// Threads  one
/// Math     docs/math/maplet.md (paper: Algorithm 1)
class MapletBuilder {
 public:
  /// @param image  the largest that keyframes are made of
  MapletBuilder(const MapletConfig& config, ImageSize image, Arena& arena);

  /// Whose maplets these are; ids count up from `first_id`. Before the first add.
  void identify(std::uint16_t agent, std::uint32_t epoch, std::uint32_t first_id) noexcept;

  /// Which way is up in the first camera's frame: maplets carry it.
  void know_up(const Mounting& mounting) noexcept { up_ = UpFinder{mounting}; }
  /// The camera moves in a plane only: so do keyframes and links.
  void hold_to(const PlanarMotion& planar) noexcept { planar_ = planar; }

  /// The next keyframe becomes an origin, the last of the maplet that ends with it: a measurement
  /// was made there. Not when it would be one keyframe too many; carry_to_origin() then.
  void ask_origin() noexcept { origin_asked_ = true; }
  /// Where a tracked frame is in the maplet under construction; nothing without a track or when its
  /// keyframe is in an older maplet.
  [[nodiscard]] std::optional<PathPoint> locate(const Track& track) const noexcept;

  /// @param keyframe  copied where needed
  /// @param frame  that it was made of: where its maplet's surfaces are seen through; or nullptr
  /// @return the maplet that ended before this keyframe, valid until the next call, or nullptr
  [[nodiscard]] const MapletCut* add(const Keyframe& keyframe, const DepthFrame* frame,
                                     Deadline deadline) noexcept;

  /// Ends the maplet under construction.
  /// @return it, or nullptr when it holds nothing that the one before it does not
  [[nodiscard]] const MapletCut* finish() noexcept;

  [[nodiscard]] const MapletCounts& counts() const noexcept { return map_.counts(); }

 private:
  struct Member {  // a keyframe of the maplet under construction
    std::uint32_t keyframe_id = 0;
    Stamp stamp{};
    Se3 T_odom_camera;
    Se3 T_origin_camera;                     // refined against the maplet's planes
    Matrix6d covariance = Matrix6d::Zero();  // of T_origin_this, tangent of this
    std::uint32_t valid_pixels = 0;
    double structure = 0.0;
  };

  void see(const Keyframe& keyframe, const DepthFrame* frame, Deadline deadline) noexcept;
  void take(const Keyframe& keyframe, Deadline deadline) noexcept;
  void start(const Keyframe& origin) noexcept;
  void start_overlapping(std::size_t shared, Deadline deadline) noexcept;
  [[nodiscard]] std::size_t choose_overlap() noexcept;
  [[nodiscard]] Member follow(const Keyframe& keyframe) const noexcept;
  [[nodiscard]] CutReason due(const Keyframe& keyframe) noexcept;
  const MapletCut* cut(CutReason reason, Deadline deadline) noexcept;
  void link_to(const Se3& T_previous_this, const Matrix6d& covariance) noexcept;
  void remember(const Keyframe& keyframe) noexcept;

  MapletConfig config_;
  PlaneMap map_;
  CutRule rule_;
  StaticVector<Member, kMaxMapletKeyframes> members_;
  // A ring: the last keyframes of the current maplet.
  StaticVector<Arena::Owned<Keyframe>,
               MapletConfig::kMaxOverlapKeyframes + MapletConfig::kMaxBoundaryKeyframes>
      recent_;
  std::size_t recent_count_ = 0;  // ever, in this segment
  std::size_t shared_ = 0;        // members that the maplet before has too
  std::uint32_t segment_ = 0;
  std::uint32_t blind_spells_ = 0;
  bool origin_asked_ = false;
  UpFinder up_{Mounting{}};
  std::optional<PlanarMotion> planar_;
  MapletKey key_;
  PathLink link_;  // of the maplet under construction
  StaticVector<Arena::Owned<KeptDepth>, kMaxMapletKeyframes> depths_;  // of the members, alike
  Arena::Owned<Maplet> draft_;
  Arena::Owned<MapletCut> cut_;
  std::span<std::byte> bytes_;
};

}  // namespace maplet
