// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/base/field.hpp"
#include "core/limits.hpp"

namespace maplet {

/// Math  docs/math/patches.md; "sigmas" are standard deviations of the frame's NoiseModel.
struct PatchConfig {
  int cell_px = 0;
  int max_node_px = 64;
  int max_patches = kMaxPatches;
  double min_valid_fraction = 0.5;
  double max_rms_sigmas = 1.8;
  double split_bias_sigmas = 1.0;
  double merge_chi2 = 12.0;
  double merge_bias_sigmas = 1.0;
  double min_incidence_cos = 0.08;
  int min_plane_cells = 4;
  bool second_look = true;

  static constexpr double kPatchLimit = kMaxPatches;

  static constexpr Field<PatchConfig> kFields[] = {
      {"cell_px", &PatchConfig::cell_px, 0, 64,
       "edge of the finest quadtree cell, a power of two; 0 chooses by the image's size"},
      {"max_node_px", &PatchConfig::max_node_px, 8, 512, "edge of the coarsest quadtree node"},
      {"max_patches", &PatchConfig::max_patches, 1, PatchConfig::kPatchLimit,
       "patches of one frame at most"},
      {"min_valid_fraction", &PatchConfig::min_valid_fraction, 0.05, 1.0,
       "share of a patch's pixels that must have a depth"},
      {"max_rms_sigmas", &PatchConfig::max_rms_sigmas, 0.5, 10.0,
       "residual at which a node is not flat any more"},
      {"split_bias_sigmas", &PatchConfig::split_bias_sigmas, 0.0, 10.0,
       "unevenness that a node may have and its cells do not, beyond noise"},
      {"merge_chi2", &PatchConfig::merge_chi2, 0.0, 1000.0,
       "chi-square (3 degrees of freedom) up to which two fits are one plane"},
      {"merge_bias_sigmas", &PatchConfig::merge_bias_sigmas, 0.0, 10.0,
       "systematic difference of two fits of one plane that the sensor's distortion explains"},
      {"min_incidence_cos", &PatchConfig::min_incidence_cos, 0.0, 1.0,
       "cosine of the angle between ray and normal below which a patch is not believed"},
      {"min_plane_cells", &PatchConfig::min_plane_cells, 1, 1000,
       "size of the smallest plane, in cells"},
      {"second_look", &PatchConfig::second_look, 0, 1,
       "assign the pixels where planes end one by one, as far as the budget allows"},
  };
};

}  // namespace maplet
