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
#include "core/odometry/patch_view.hpp"

namespace maplet {

/// A keyframe to align to.
struct Reference {
  const PatchView* view;
  Se3 T_reference_odom;
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
  Matrix6d information = Matrix6d::Zero();  ///< of the patches alone, free axes projected out
  StaticVector<Vector6d, 6> free_axes;      ///< unit tangents
  double chi2_per_dof = 0.0;                ///< of the inliers
  std::uint32_t inliers = 0;
  double overlap = 0.0;        ///< share of the frame's patch pixels on inliers, best reference
  double first_overlap = 0.0;  ///< the same for the first reference
  std::uint32_t iterations = 0;
  Stop stop = Stop::kConverged;
};

/// Aligns a frame's patches to those of keyframes: projective association, Mahalanobis distance of
/// inverse-depth planes, heavy tails, Gauss-Newton.
///
/// Memory   fixed, from the arena: kMaxPatches pairs a reference.
/// Time     O(iterations * references * patches); overruns the deadline by one iteration at most.
/// Threads  one caller at a time.
/// Math     docs/math/odometry.md, eq. 1-8.
class PatchAligner {
 public:
  static constexpr std::size_t kMaxReferences = 3;

  PatchAligner(const OdometryConfig& config, Arena& arena);

  [[nodiscard]] Alignment run(const PatchView& frame, std::span<const Reference> references,
                              const PosePrior& prior, const Start& start,
                              Deadline deadline) noexcept;

 private:
  struct Pair {
    const Facet* frame;
    const Facet* reference;
    Eigen::Matrix3d weight;  ///< inverse covariance of the residual
  };
  struct Slack {
    double m, rad;       ///< added to what normals and distances may differ, one sigma
    std::size_t facets;  ///< the largest only
  };
  struct Sums;

  void associate(const PatchView& frame, std::span<const Reference> references, const Se3& T,
                 const Slack& slack) noexcept;
  void associate_with(const PatchView& frame, const Reference& reference, const Se3& T,
                      const Slack& slack) noexcept;
  [[nodiscard]] Sums accumulate(std::span<const Reference> references, const Se3& T) const noexcept;
  [[nodiscard]] Matrix6d spurious(std::span<const Reference> references,
                                  const Se3& T) const noexcept;
  void finish(std::span<const Facet> facets, std::span<const Reference> references,
              Alignment& out) const noexcept;

  OdometryConfig config_;
  std::span<Pair> pairs_;
  std::size_t pair_count_ = 0;
  std::array<std::size_t, kMaxReferences> pair_end_{};  ///< of each reference's pairs
};

}  // namespace maplet
