// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/base/deadline.hpp"
#include "core/base/static_vector.hpp"
#include "core/geometry/se3.hpp"
#include "core/odometry/odometry_config.hpp"
#include "core/odometry/pair_sums.hpp"
#include "core/odometry/patch_view.hpp"
#include "core/odometry/photo_term.hpp"
#include "core/odometry/pose_information.hpp"

namespace maplet {

/// Patches to align to.
struct Reference {
  PatchView* view;
  Se3 T_reference_odom;
  /// The frame before, not a keyframe: it steadies the estimate, but its own error is not counted
  /// anywhere, so it is no evidence about keyframes. Comes last.
  bool previous = false;
};

/// What is known of the camera before looking at the frame.
struct PosePrior {
  Se3 T_odom_camera;
  Matrix6d information = Matrix6d::Zero();  ///< tangent of camera
};

/// Where to begin, and how far off that may be: patches are compared with that much slack first.
struct Start {
  Se3 T_odom_camera;
  double sigma_m = 0.0;
  double sigma_rad = 0.0;
};

struct Alignment {
  Se3 T_odom_camera;
  Matrix6d information = Matrix6d::Zero();  ///< of the keyframes alone, free axes projected out
  StaticVector<Vector6d, 6> free_axes;      ///< unit tangents
  double chi2_per_dof = 0.0;                ///< of the inliers
  /// How far the keyframes pull apart, squared, and what their information lets expect.
  double disagreement = 0.0;
  double expected_disagreement = 0.0;
  /// The same of intensities against patches.
  double photo_disagreement = 0.0;
  double expected_photo_disagreement = 0.0;
  double photo_inflation = 1.0;  ///< of the points' information, measured against the patches'
  bool gray = false;             ///< intensities took part
  std::uint32_t inliers = 0;
  double overlap = 0.0;        ///< share of the frame's patch pixels on inliers, best reference
  double first_overlap = 0.0;  ///< the same for the first reference
  /// Of the pixels that lie on a patch of that best reference, the share on inliers: what both
  /// views should see is there.
  double agreement = 0.0;
  double most_agreement = 0.0;   ///< the same for whichever agrees most, of those much seen
  double older_agreement = 1.0;  ///< the same for an older keyframe; 1 without one
  std::uint32_t iterations = 0;
  Stop stop = Stop::kConverged;
};

/// Whether it is evidence of a pose at all.
[[nodiscard]] bool usable(const Alignment& alignment, const OdometryConfig& config) noexcept;

inline constexpr double kFoundOverlap = 0.4;  ///< a view is recognised, not just tracked on
/// Whether it shows by itself where the camera is: usable, well overlapping, nothing left free.
[[nodiscard]] bool recognised(const Alignment& alignment, const OdometryConfig& config) noexcept;

/// Aligns a frame's patches to those of keyframes: projective association, Mahalanobis distance of
/// inverse-depth planes, heavy tails, Gauss-Newton. Intensities may join in.
///
/// Memory   fixed, from the arena: config.max_patches pairs a reference.
/// Time     O(iterations * references * patches); overruns the deadline by one iteration at most.
/// Threads  one caller at a time.
/// Math     docs/math/odometry.md, eq. 1-8, 13-15.
class PatchAligner {
 public:
  static constexpr std::size_t kMaxReferences = 3;

  PatchAligner(const OdometryConfig& config, Arena& arena);

  /// @param photo  against the first reference; empty without gray
  [[nodiscard]] Alignment run(const PatchView& frame, std::span<const Reference> references,
                              const PosePrior& prior, const Start& start, PhotoTerm& photo,
                              Deadline deadline) noexcept;

 private:
  struct Slack {
    double m, rad;       ///< added to what normals and distances may differ, one sigma
    std::size_t facets;  ///< the largest only
  };
  using References = std::span<const Reference>;

  void associate(const PatchView& frame, References references, const Se3& T,
                 const Slack& slack) noexcept;
  [[nodiscard]] double associate_with(const PatchView& frame, const Reference& reference,
                                      const Se3& T, const Slack& slack) noexcept;
  [[nodiscard]] bool finer(Slack& slack, const PatchView& frame) const noexcept;
  [[nodiscard]] std::span<const FacetPair> pairs_of(std::size_t reference) const noexcept {
    const std::size_t begin = reference == 0 ? 0 : pair_end_[reference - 1];
    return pairs_.subspan(begin, pair_end_[reference] - begin);
  }
  [[nodiscard]] PairEvidence evidence(References references, const Se3& T) const noexcept;
  [[nodiscard]] Matrix6d spurious(References references, const Se3& T) const noexcept;
  void judge(std::span<const Facet> facets, References references, Alignment& out) noexcept;
  void weigh(References references, PhotoTerm& photo, Alignment& out) noexcept;
  void weigh_photo(const NormalEquations& patches, const NormalEquations& points, PhotoTerm& photo,
                   Alignment& out) noexcept;

  OdometryConfig config_;
  Vector6d scale_;  ///< what counts as known
  std::span<FacetPair> pairs_;
  std::size_t pair_count_ = 0;
  std::array<std::size_t, kMaxReferences> pair_end_{};  ///< of each reference's pairs
  double trust_ = 1.0;                                  ///< in fresh pairs: all, or hardly any
  std::array<double, kMaxReferences> landed_{};  ///< pixels of the frame on patches of each one
  ScoreBlocks blocks_;
};

}  // namespace maplet
