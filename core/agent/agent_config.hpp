// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/base/field.hpp"
#include "core/frame/decimator.hpp"
#include "core/frame/image_size.hpp"
#include "core/limits.hpp"
#include "core/maplet/config.hpp"
#include "core/maplet/up_finder.hpp"
#include "core/odometry/odometry_config.hpp"
#include "core/patches/patch_config.hpp"
#include "core/registration/config.hpp"
#include "core/skeleton/skeleton.hpp"

namespace maplet {

/// How one frame's time is spent. Shares are of the whole budget; what a stage leaves over, the
/// next ones may use up to their own share.
struct FrameConfig {
  Duration budget = std::chrono::milliseconds{20};
  double patches_share = 0.4;
  double odometry_share = 0.4;
  double maplet_share = 0.3;
  double registration_share = 0.3;
  double skeleton_share = 0.3;

  static constexpr Field<FrameConfig> kFields[] = {
      {"budget_us", &FrameConfig::budget, 50, 1e6,
       "Time from pixels in memory to the step's result"},
      {"patches_share", &FrameConfig::patches_share, 0.01, 1.0, "Of the budget, at most"},
      {"odometry_share", &FrameConfig::odometry_share, 0.01, 1.0, "Of the budget, at most"},
      {"maplet_share", &FrameConfig::maplet_share, 0.01, 1.0, "Of the budget, at most"},
      {"registration_share", &FrameConfig::registration_share, 0.01, 1.0, "Of the budget, at most"},
      {"skeleton_share", &FrameConfig::skeleton_share, 0.01, 1.0, "Of the budget, at most"},
  };
};

/// What is kept. Sizes the arena.
struct LimitsConfig {
  int own_maplets = 512;
  int foreign_maplets = 1024;
  int image_width_px = 640;
  int image_height_px = 480;

  [[nodiscard]] ImageSize image() const noexcept { return {image_width_px, image_height_px}; }
  /// Of an encoded maplet, on average and rounded up: small images see fewer planes.
  [[nodiscard]] std::size_t expected_maplet_bytes() const noexcept {
    return image().pixels() <= ImageSize{320, 240}.pixels() ? 2560 : 4096;
  }

  static constexpr Field<LimitsConfig> kFields[] = {
      {"own_maplets", &LimitsConfig::own_maplets, 2, 65536,
       "Maplets of this agent kept in memory; beyond it the oldest goes, counted"},
      {"foreign_maplets", &LimitsConfig::foreign_maplets, 1, 65536,
       "Maplets of other agents kept to find common places; beyond it the oldest goes"},
      {"image_width_px", &LimitsConfig::image_width_px, 16, kMaxWidthPx,
       "Widest image a source may have: memory is reserved for it"},
      {"image_height_px", &LimitsConfig::image_height_px, 16, kMaxHeightPx,
       "Highest image a source may have"},
  };
};

struct AgentConfig {
  /// The camera moves in the plane across `up` only.
  bool planar = false;
  Mounting mounting;
  FrameConfig frame;
  DecimatorConfig decimator;
  PatchConfig patches;
  OdometryConfig odometry;
  MapletConfig maplet;
  RegistrationConfig registration;
  SkeletonConfig skeleton;
  LimitsConfig limits;
};

}  // namespace maplet
