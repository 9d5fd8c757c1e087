// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/geometry/se3.hpp"
#include "core/odometry/odometry_config.hpp"
#include "core/odometry/sym3.hpp"
#include "core/patches/patch.hpp"

namespace maplet {

/// What the alignment reads of a patch.
struct alignas(64) Facet {
  // One line of a cache: what each step of an alignment reads.
  Eigen::Vector3d theta;  ///< 1/m
  /// The best known theta of the surface it lies on: of its plane if it has one. Normals of patches
  /// are noisy; as a Jacobian they would claim to see free directions.
  Eigen::Vector3d surface;
  double pixels;
  std::uint8_t block;  ///< of the image: ScoreBlocks
  bool moved = false;  ///< it does not stand still: no reference
  bool stood = false;  ///< a keyframe saw it where it is
  bool fresh = false;  ///< nobody knows yet whether it stands still: a weak reference

  Sym3 covariance;         ///< of theta, with the sensor's bias
  Eigen::Vector3d centre;  ///< camera frame, m
  Sym3 surface_covariance;
};

/// A frame's patches as the alignment reads them: the largest first, and which one lies at a pixel.
///
/// Memory  fixed, from the arena: `facets` facets and a grid of at most 160 x 128 cells.
/// Time    assign(): O(patches log patches + cells); at(): O(1).
class PatchView {
 public:
  static constexpr int kNone = -1;

  /// @param facets  kept of a frame, the largest
  PatchView(std::size_t facets, Arena& arena);

  void assign(const PatchSet& patches, const OdometryConfig& config) noexcept;

  [[nodiscard]] std::span<const Facet> facets() const noexcept { return facets_.first(size_); }
  [[nodiscard]] std::span<Facet> facets() noexcept { return facets_.first(size_); }
  [[nodiscard]] const CameraModel& camera() const noexcept { return camera_; }
  /// Pixels on all facets.
  [[nodiscard]] double pixels() const noexcept { return pixels_; }
  /// How many frames were held against it, to see what moves; this is one more.
  int count_frame() noexcept { return ++frames_; }

  /// The share of the largest facets' pixels that lie on `other`'s surfaces, within a tenth of
  /// their inverse depth. Time O(1): 48 facets are looked at.
  [[nodiscard]] double share_on(const PatchView& other, const Se3& T_other_this) const noexcept;

  /// Index of the facet that a point (camera frame, m) projects onto, or kNone.
  [[nodiscard]] int at(const Eigen::Vector3d& point) const noexcept {
    if (point.z() <= kMinDepthM) return kNone;
    const double inverse = 1.0 / point.z();
    return at_pixel(camera_.fx_px * point.x() * inverse + camera_.cx_px + 0.5,
                    camera_.fy_px * point.y() * inverse + camera_.cy_px + 0.5);
  }

  /// Whether what lies at a point (camera frame, m) does not stand still.
  [[nodiscard]] bool moves_at(const Eigen::Vector3d& point) const noexcept {
    const int found = at(point);
    return found != kNone && facets()[static_cast<std::size_t>(found)].moved;
  }

  /// The facets to the left, right, above and below of one of its own, or kNone.
  [[nodiscard]] std::array<int, 4> beside(const Facet& facet) const noexcept;

  /// Whether it saw through where a point (camera frame, m) is, there and a little beside.
  [[nodiscard]] bool sees_through(const Eigen::Vector3d& point) const noexcept;

 private:
  [[nodiscard]] int at_pixel(double u, double v) const noexcept {
    // Written so that NaN fails.
    if (!(u >= 0.0 && v >= 0.0 && u < camera_.width_px && v < camera_.height_px)) return kNone;
    const int index = grid_[static_cast<std::size_t>((static_cast<int>(v) / cell_px_) * columns_ +
                                                     static_cast<int>(u) / cell_px_)];
    return index == kEmpty ? kNone : index;
  }

  static constexpr int kMaxColumns = 160;
  static constexpr int kMaxRows = 128;
  static constexpr std::uint16_t kEmpty = 0xFFFF;
  static constexpr double kMinDepthM = 0.05;

  void fill_grid(const PatchSet& patches) noexcept;

  std::span<Facet> facets_;
  std::span<std::uint16_t> order_;  ///< of the patches, largest first
  std::span<std::uint16_t> grid_;
  CameraModel camera_;
  std::size_t size_ = 0;
  double pixels_ = 0.0;
  int frames_ = 0;
  int cell_px_ = 1;
  int columns_ = 0;
};

}  // namespace maplet
