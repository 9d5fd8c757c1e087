// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/odometry/photo_view.hpp"

#include <algorithm>
#include <cmath>

namespace maplet {

namespace {

constexpr int kColumns = 40;  // blocks
constexpr int kRows = 32;
static_assert(kColumns * kRows <= PhotoView::kMaxPoints);
constexpr int kProbes = 4;             // along and down a block
constexpr float kMinSteepness = 3.0F;  // intensity levels over two pixels
constexpr double kSmooth = 0.02;       // depth may change by this share beside a point
constexpr double kOffPatch = 0.03;     // of depth; a pixel farther off its patch is no part of it

// The depth of a pixel on a smooth surface, m; 0 elsewhere. Read from the patch where there is
// one: that is free of the pixel's noise.
double smooth_depth(const DepthFrame& frame, const PatchSet& patches, int u, int v) noexcept {
  constexpr int kReach = 2;
  const auto& depth = frame.depth;
  if (u < kReach || v < kReach || u >= depth.width_px - kReach || v >= depth.height_px - kReach) {
    return 0.0;
  }
  const int here = depth.at(u, v);
  if (here == 0) return 0.0;
  const int limit = std::max(1, static_cast<int>(kSmooth * here));
  for (const auto& [du, dv] : {std::pair{-kReach, 0}, {kReach, 0}, {0, -kReach}, {0, kReach}}) {
    const int beside = depth.at(u + du, v + dv);
    if (beside == 0 || std::abs(beside - here) > limit) return 0.0;
  }
  const double measured = here * frame.metres_per_unit;
  const Patch* patch = patches.patch_at(u, v);
  if (patch == nullptr) return measured;
  const double fitted = 1.0 / patch->theta.dot(frame.camera.ray(u, v));
  return std::abs(fitted - measured) < kOffPatch * measured ? fitted : measured;
}

// Intensity and steepness at (u, v) of a level, or nothing near its border. Both are interpolated
// alike: the noise of the one must not be that of the other, or the steepest points are those whose
// noise pushes them to one side.
bool look(const GrayPyramid::Level& level, double u, double v, float& intensity,
          float& steepness) noexcept {
  const int width = level.camera.width_px;
  if (!(u >= 1.0 && v >= 1.0 && u < width - 2.0 && v < level.camera.height_px - 2.0)) return false;
  const int column = static_cast<int>(u);
  const int row = static_cast<int>(v);
  const float a = static_cast<float>(u - column);
  const float b = static_cast<float>(v - row);
  const std::uint8_t* p = level.pixels + row * width + column;
  const auto along = [a](const std::uint8_t* q) {
    return (1.0F - a) * static_cast<float>(q[0]) + a * static_cast<float>(q[1]);
  };
  const float here = along(p);
  const float below = along(p + width);
  intensity = (1.0F - b) * here + b * below;
  const float gx = (1.0F - b) * (along(p + 1) - along(p - 1)) +
                   b * (along(p + width + 1) - along(p + width - 1));
  const float gy = (1.0F - b) * (below - along(p - width)) + b * (along(p + 2 * width) - here);
  steepness = std::abs(gx) + std::abs(gy);
  return true;
}

}  // namespace

PhotoView::PhotoView(Arena& arena)
    : best_{arena.make_array<Best>(kMaxPoints, "odometry/photo-blocks")} {
  for (auto& level : points_) {
    level = arena.make_array<PhotoPoint>(kMaxPoints, "odometry/photo-points");
  }
}

void PhotoView::assign(const DepthFrame& frame, const PatchSet& patches, const PatchView& view,
                       const GrayPyramid& gray, const Se3& T_gray_depth) noexcept {
  clear();
  if (gray.empty() || frame.depth.empty()) return;
  const int width = frame.depth.width_px;
  const int height = frame.depth.height_px;
  const Eigen::Matrix3d R = T_gray_depth.rotation();
  for (int l = 0; l < GrayPyramid::kLevels; ++l) {
    const GrayPyramid::Level& level = gray.level(l);
    const int columns = kColumns >> l;
    const int rows = kRows >> l;
    const auto blocks = static_cast<std::size_t>(columns * rows);
    for (Best& best : best_.first(blocks)) best.steepness = kMinSteepness;
    const int probes = kProbes << std::min(l, 1);
    for (int y = 0; y < rows * probes; ++y) {
      const int v = (2 * y + 1) * height / (2 * rows * probes);
      for (int x = 0; x < columns * probes; ++x) {
        const int u = (2 * x + 1) * width / (2 * columns * probes) - ((x + y) & 1);
        const double z = smooth_depth(frame, patches, u, v);
        if (z <= 0.0) continue;
        const Eigen::Vector3d p = z * frame.camera.ray(u, v);
        const Eigen::Vector3d in_gray = R * p + T_gray_depth.t;
        if (in_gray.z() <= 0.0) continue;
        const Eigen::Vector2d at = level.camera.project(in_gray);
        Best& best = best_[static_cast<std::size_t>((y / probes) * columns + x / probes)];
        float intensity = 0.0F;
        float steepness = 0.0F;
        if (!look(level, at.x(), at.y(), intensity, steepness)) continue;
        if (steepness <= best.steepness || view.moves_at(p)) continue;
        best = {steepness, {p.cast<float>(), intensity}};
      }
    }
    std::size_t& size = size_[static_cast<std::size_t>(l)];
    for (const Best& best : best_.first(blocks)) {
      if (best.steepness <= kMinSteepness) continue;
      points_[static_cast<std::size_t>(l)][size++] = best.point;
    }
  }
}

}  // namespace maplet
