// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/base/deadline.hpp"
#include "core/base/static_vector.hpp"
#include "core/maplet/cell_map.hpp"
#include "core/maplet/config.hpp"
#include "core/maplet/depth_look.hpp"
#include "core/maplet/fused_plane.hpp"
#include "core/maplet/maplet.hpp"
#include "core/patches/patch.hpp"

namespace maplet {

/// What was not taken into a maplet, and why. Counts since start-up.
struct MapletCounts {
  std::uint64_t planes_dropped = 0;  ///< no room: the least informative; or astray
  std::uint64_t patches_unfit = 0;   ///< off the plane that they were said to belong to
  std::uint64_t patches_loose = 0;   ///< on no plane
  std::uint64_t patches_placed = 0;
  std::uint64_t tiles_missing = 0;    ///< no room for more extent
  std::uint64_t deadline_misses = 0;  ///< looks at a plane's cells not taken in time
  std::uint64_t planes_trimmed = 0;   ///< left out to keep maplet.max_bytes
  std::uint64_t quads_kept = 0;       ///< loose patches that are worth a plane of their own
  std::uint64_t quads_left_out = 0;
  std::uint64_t cells_carved = 0;    ///< seen through their plane as it was in the end
  std::uint64_t hidden_origins = 0;  ///< a surface is between them and the origin before
};

/// Depth pixels of a maplet's keyframes, and how many of them its planes stand for.
struct PointShare {
  std::uint64_t seen = 0;
  std::uint64_t kept = 0;
};

/// A keyframe's depth, and where it was taken.
struct KeyframeLook {
  Se3 T_maplet_camera;
  const KeptDepth* depth;
};

/// The planes of the maplet under construction and what keyframes saw of them.
///
/// Memory   kPlanes planes, a CellMap, the order of a frame's patches, in the arena (~1.3 MB).
/// Time     of add: O(patches * planes + cells in view); cells in view stop at the deadline.
/// Math     docs/math/maplet.md, eq. 3-7.
class PlaneMap {
 public:
  static constexpr std::size_t kPlanes = 256;

  PlaneMap(const MapletConfig& config, Arena& arena);
  void clear() noexcept;

  /// A keyframe's pose as the planes of the map have it, odometry held against them.
  /// @param T  as the odometry continues from the keyframe before
  /// @param covariance  of T against that keyframe, tangent of camera
  /// @return T as refined; as it was where planes say little
  [[nodiscard]] Se3 refine(const PatchSet& set, const Se3& T, const Matrix6d& covariance) noexcept;

  /// Fuses a keyframe's planes and patches.
  /// @param depth  what the keyframe saw
  /// @param covariance  of T_maplet_camera, tangent of camera
  void add(const PatchSet& set, const KeptDepth& depth, const Se3& T_maplet_camera,
           const Matrix6d& covariance, Deadline deadline) noexcept;

  /// Writes the planes into `out`, the most informative first. Cells that keyframes saw through the
  /// planes as they are in the end are left out: those that were looked at when they were added had
  /// not settled yet.
  /// @param looks  what the keyframes saw; none: cells stay as add() left them
  /// @param limit  planes at most
  /// @param deadline  of the looks: from there on cells stay as add() left them
  void assemble(Maplet& out, std::span<const KeyframeLook> looks, std::size_t limit,
                Deadline deadline) noexcept;

  /// Of what the last assemble wrote.
  [[nodiscard]] const PointShare& points() const noexcept { return points_; }

  /// Whether no surface is between two points of the maplet's frame, or closer to the line than
  /// half a cell.
  /// Time   O(planes)
  [[nodiscard]] bool open(const Eigen::Vector3d& from, const Eigen::Vector3d& to) noexcept;

  /// What assemble would about encode to.
  [[nodiscard]] std::size_t estimated_bytes() const noexcept;
  [[nodiscard]] std::span<const FusedPlane> planes() const noexcept { return planes_.span(); }
  [[nodiscard]] const MapletCounts& counts() const noexcept { return counts_; }
  [[nodiscard]] MapletCounts& counts() noexcept { return counts_; }

 private:
  struct View;  // one keyframe, while it is added

  struct GridLook;  // one keyframe's at one plane

  // An arena array that is filled from the front.
  struct PlaneList {
    std::span<FusedPlane> storage;
    std::size_t count = 0;
    [[nodiscard]] std::span<FusedPlane> span() const noexcept { return storage.first(count); }
  };

  void sort_patches(const PatchSet& set) noexcept;
  [[nodiscard]] PlaneSighting sight(const View& view, std::size_t frame_plane) const noexcept;
  [[nodiscard]] PlaneSighting sight(const View& view, const Plane& plane,
                                    const Eigen::Matrix3d& information,
                                    const Eigen::Vector3d& centre) const noexcept;
  [[nodiscard]] FusedPlane* associate(const View& view, const PlaneSighting& sighting,
                                      std::size_t frame_plane) noexcept;
  [[nodiscard]] bool touches(const View& view, const FusedPlane& plane,
                             std::size_t frame_plane) noexcept;
  [[nodiscard]] bool beside(const FusedPlane& plane, const Eigen::Vector3d& p, int reach) noexcept;
  [[nodiscard]] FusedPlane* make_plane(const PlaneSighting& sighting) noexcept;
  void place_patch(const View& view, FusedPlane& plane, const Patch& patch) noexcept;
  void place_loose(const View& view) noexcept;
  void place_quad(const View& view, const Patch& patch) noexcept;
  void merge_alike() noexcept;
  void absorb(FusedPlane& keep, FusedPlane& gone) noexcept;
  void look(const KeyframeLook& keyframe, Deadline deadline) noexcept;
  template <class F>
  void for_occupied(const FusedPlane& plane, F f) const noexcept;
  [[nodiscard]] bool surface_in(const FusedPlane& from, const PlaneBasis& basis,
                                const CellGrid& grid, int column, int row) const noexcept;
  [[nodiscard]] bool lay_grid(const FusedPlane& from, Maplet& out,
                              MapletPlane& plane) const noexcept;
  void carve(std::span<const KeyframeLook> looks, Maplet& out, const MapletPlane& plane) noexcept;
  void look_along(const GridLook& view, int line, const Maplet& out, const CellGrid& grid,
                  std::span<CellLooks> cells) const noexcept;
  void look_at_tile(const DepthLook& look, const Se3& T_camera_maplet, const FusedPlane& plane,
                    Tile& tile) const noexcept;

  MapletConfig config_;
  CellMap cells_;
  PlaneList planes_;
  std::span<std::uint16_t> order_;     // patches, those of one frame plane together
  std::span<std::uint16_t> first_of_;  // of each frame plane in order_
  std::span<std::uint16_t> ranked_;    // planes, for assemble
  std::uint32_t serial_ = 0;
  std::uint32_t keyframe_ = 0;
  MapletCounts counts_;
  PointShare points_;
};

}  // namespace maplet
