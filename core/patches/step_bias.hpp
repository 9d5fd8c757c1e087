// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <complex>

#include "core/patches/moments.hpp"

namespace maplet {

/// Sums of exp(i phase) over a surface's pixels, and of that times u and v from its centre; the
/// phase goes round once in a step of disparity.
struct StepWave {
  std::complex<double> one, u, v;
};

/// What rounding to whole steps of disparity does to a plane. Where few steps pass along a surface
/// its pixels err alike, which neither averages out nor shows in the residual.
///
/// Memory   none.
/// Time     O(1) a call.
/// Threads  reentrant.
/// Math     docs/math/patches.md, eq. 20-22
class StepBias {
 public:
  StepBias() = default;
  /// @param step      of disparity, in steps of kInverseDepthSteps; what is not above 0 is none
  /// @param variance  of a pixel's w, rounding included, steps^2
  /// @param unit_m    in which depth is written
  StepBias(double step, double variance, double unit_m) noexcept;

  /// Variance of the error that neighbouring pixels share, steps^2.
  /// @param w  inverse depth of the surface, steps
  [[nodiscard]] double power(double w) const noexcept;

  /// Variance of what rounding leaves of a surface's error however many pixels it has, steps^2.
  [[nodiscard]] double residue(double w) const noexcept;

  /// Whether the wave of a surface can make a difference beside this noise (eq. 14), steps^2.
  [[nodiscard]] bool matters(const Fit& surface, const Moments& moments,
                             double noise_power) const noexcept;

  /// Adds part of a surface.
  /// @param width_px, height_px  of the part
  void add(const Fit& surface, const Moments& part, double width_px, double height_px,
           StepWave& wave) const noexcept;

  /// Lowers a surface's information by what its pixels err alike.
  /// @param wave  of all its pixels, or of most: it is scaled to them
  void weaken(Eigen::Matrix3d& information, double noise_power, const PixelFrame& frame,
              const Fit& surface, const Moments& moments, const StepWave& wave,
              double wave_pixels) const noexcept;

 private:
  double radians_per_w_ = 0.0;   ///< 0: no steps
  double rounding_power_ = 0.0;  ///< steps^2
  double residue_ = 0.0;         ///< steps^2
  double unit_power_ = 0.0;    ///< of rounding to units of depth, as the pixels of a step share it
  double unit_residue_ = 0.0;  ///< both times w^4
};

}  // namespace maplet
