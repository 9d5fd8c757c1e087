// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "core/frame/noise_model.hpp"
#include "drivers/sim/options.hpp"
#include "drivers/sim/raster.hpp"

namespace maplet::sim {

/// What a structured-light camera of the Kinect class makes of exact inverse depth.
///
/// In this order, for each pixel:
///  1. shadow: what the projector, 75 mm beside the camera, does not light has no depth;
///  2. lateral noise: depth is read at a place shifted by N(0, 0.5 px) in both directions
///     (Handa et al. 2014, after Barron and Malik 2013): edges get ragged, nothing flies between;
///  3. disparity noise: sigma(1/Z) = k = 1.425e-3 1/m, so sigma_Z = k Z^2 (Khoshelham and Elberink
///     2012), quantisation included, averaged over 2 x 2 pixels as the matching window does;
///  4. quantisation to 1/8 px of disparity (1/Z = D / (8 f b), both papers), then to whole mm;
///  5. drop-out at grazing angles (Nguyen et al. 2012: noise explodes from 60 deg, no depth beyond
///     82 deg or so), at depth steps, and out of range.
/// `handa` takes ICL-NUIM's figures for 3: sigma of 1/6 disparity unit, independent pixels.
///
///   K. Khoshelham, S. Oude Elberink: Accuracy and resolution of Kinect depth data for indoor
///     mapping applications, Sensors 12(2), 2012.
///   C. V. Nguyen, S. Izadi, D. Lovell: Modeling Kinect sensor noise for improved 3D
///     reconstruction and tracking, 3DIMPVT 2012.
///   A. Handa, T. Whelan, J. McDonald, A. Davison: A benchmark for RGB-D visual odometry, 3D
///     reconstruction and SLAM, ICRA 2014.
///   J. T. Barron, J. Malik: Intrinsic scene properties from a single RGB-D image, CVPR 2013.
///
/// Memory   a few rows and one flag a pixel, made by the constructor; measure() allocates nothing.
/// Time     O(pixels).
class Sensor {
 public:
  Sensor(const World& world, const CameraModel& camera, const SimOptions& options);

  /// @param depth_mm  whole mm, 0 = no return
  /// @param label     plane id of what the pixel's depth was read from; 0 where there is none
  void measure(const Raster& raster, std::uint64_t frame, std::uint16_t* depth_mm,
               std::uint16_t* label) noexcept;

  /// What an estimator may assume about the depth.
  [[nodiscard]] NoiseModel noise_model() const noexcept;

 private:
  /// One row of raw draws (one more column than the image), and one of what they come to.
  struct Draws {
    std::vector<std::uint16_t> disparity, across, down, dice;
  };
  struct Noise {
    std::vector<float> disparity, across, down;  ///< units, px, px
  };

  void measure_exact(const Raster& raster, std::uint16_t* depth_mm, std::uint16_t* label) noexcept;
  void draw_row(int v, std::uint64_t key, Draws& draws) noexcept;
  void make_noise() noexcept;
  void find_shadow(const float* inverse) noexcept;
  [[nodiscard]] bool misses(const float* inverse, int u, int v, float w,
                            float distance) const noexcept;
  void measure_row(const Raster& raster, int v, std::uint16_t* depth_mm,
                   std::uint16_t* label) noexcept;

  CameraModel camera_;
  SimOptions options_;
  std::uint64_t key_;
  std::vector<std::uint16_t> plane_of_;  ///< by surface
  float units_m_;                        ///< disparity units of 1/8 px: D = units_m / Z
  float disparity_sd_;                   ///< of the noise before quantisation, units
  float shift_sd_px_;
  Draws now_, above_;
  Noise noise_;
  std::vector<float> ray_x2_, ray_y2_;  ///< squared ray slopes, for the angle of incidence
  std::vector<std::uint8_t> shadow_;    ///< of one row
};

}  // namespace maplet::sim
