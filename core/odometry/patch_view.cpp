// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/odometry/patch_view.hpp"

#include <algorithm>
#include <cmath>

#include "core/odometry/pose_information.hpp"

namespace maplet {

namespace {

// The eigenvalue of a patch's information that a tiny or degenerate patch may lack, m^2.
constexpr double kMinInformation = 1e-9;
constexpr std::size_t kProbes = 48;      // facets that are looked for in another view
constexpr double kProbeTolerance = 0.1;  // of inverse depth
constexpr int kLeastProbes = 3;
constexpr double kBesideCells = 2.0;  // what is seen through is more than an edge wide

Sym3 invert(const Eigen::Matrix3d& information) noexcept {
  Sym3 sum = Sym3::of(information);
  sum.xx += kMinInformation;
  sum.yy += kMinInformation;
  sum.zz += kMinInformation;
  return sum.inverse();
}

}  // namespace

PatchView::PatchView(std::size_t facets, Arena& arena)
    : facets_{arena.make_array<Facet>(facets, "odometry/facets")},
      order_{arena.make_array<std::uint16_t>(kMaxPatches, "odometry/facet-order")},
      grid_{arena.make_array<std::uint16_t>(kMaxColumns * kMaxRows, "odometry/facet-grid")} {}

void PatchView::assign(const PatchSet& set, const OdometryConfig& config) noexcept {
  camera_ = set.camera;
  size_ = 0;
  frames_ = 0;
  pixels_ = 0.0;
  const std::size_t count = set.patches.size();
  for (std::size_t i = 0; i < count; ++i) order_[i] = static_cast<std::uint16_t>(i);
  std::sort(order_.begin(), order_.begin() + count, [&](std::uint16_t a, std::uint16_t b) {
    const auto pixels_a = set.patches[a].pixels;
    const auto pixels_b = set.patches[b].pixels;
    return pixels_a != pixels_b ? pixels_a > pixels_b : a < b;
  });
  const std::size_t kept = std::min({count, facets_.size(), facets_of(config)});
  for (std::size_t i = 0; i < kept; ++i) {
    const Patch& patch = set.patches[order_[i]];
    const double pixels = patch.pixels;
    Facet& facet = facets_[size_];
    facet.theta = patch.theta;
    // Averaging stops where the sensor's bias begins (docs/math/odometry.md, eq. 2).
    const double bias = 1.0 + pixels / config.saturation_px;
    const Sym3 covariance = invert(patch.information);
    facet.covariance = covariance * bias;
    facet.surface = patch.theta;
    facet.surface_covariance = covariance;
    if (patch.plane != Patch::kNoPlane) {
      const FramePlane& plane = set.planes[static_cast<std::size_t>(patch.plane)];
      facet.surface = plane.theta;
      facet.surface_covariance = invert(plane.information);
    }
    facet.moved = false;
    facet.stood = false;
    facet.fresh = false;
    facet.centre = patch.centre();
    facet.pixels = pixels;
    facet.block = score_block(patch.u_px + 0.5 * patch.width_px, patch.v_px + 0.5 * patch.height_px,
                              std::max(camera_.width_px, 1), std::max(camera_.height_px, 1));
    if (!(facet.centre.z() > kMinDepthM) || !std::isfinite(facet.covariance.trace())) {
      order_[i] = kEmpty;
      continue;
    }
    order_[size_++] = order_[i];
    pixels_ += pixels;
  }
  fill_grid(set);
}

double PatchView::share_on(const PatchView& other, const Se3& T_other_this) const noexcept {
  double seen = 0.0;
  double all = 1.0;
  for (const Facet& facet : facets().first(std::min(kProbes, size_))) {
    all += facet.pixels;
    const Eigen::Vector3d point = T_other_this * facet.centre;
    const int found = other.at(point);
    if (found == kNone) continue;
    const double there = other.facets()[static_cast<std::size_t>(found)].theta.dot(point);
    if (std::abs(there - 1.0) < kProbeTolerance) seen += facet.pixels;
  }
  return seen / all;
}

std::array<int, 4> PatchView::beside(const Facet& facet) const noexcept {
  const double u = camera_.fx_px * facet.centre.x() / facet.centre.z() + camera_.cx_px + 0.5;
  const double v = camera_.fy_px * facet.centre.y() / facet.centre.z() + camera_.cy_px + 0.5;
  const double reach = 0.5 * std::sqrt(facet.pixels) + cell_px_;
  return {at_pixel(u - reach, v), at_pixel(u + reach, v), at_pixel(u, v - reach),
          at_pixel(u, v + reach)};
}

bool PatchView::sees_through(const Eigen::Vector3d& point) const noexcept {
  if (point.z() <= kMinDepthM) return false;
  const double u = camera_.fx_px * point.x() / point.z() + camera_.cx_px + 0.5;
  const double v = camera_.fy_px * point.y() / point.z() + camera_.cy_px + 0.5;
  const double beside = kBesideCells * cell_px_;
  int seen = 0;
  for (const auto& [du, dv] :
       {std::pair{0.0, 0.0}, {-beside, 0.0}, {beside, 0.0}, {0.0, -beside}, {0.0, beside}}) {
    const int found = at_pixel(u + du, v + dv);
    if (found == kNone) continue;
    // Inverse depth of the surface there, times the depth of the point.
    const double there = facets()[static_cast<std::size_t>(found)].theta.dot(point);
    if (!(there < 1.0 - kProbeTolerance)) return false;
    ++seen;
  }
  return seen >= kLeastProbes;
}

void PatchView::fill_grid(const PatchSet& set) noexcept {
  const int width = std::max(camera_.width_px, 1);
  const int height = std::max(camera_.height_px, 1);
  cell_px_ = std::max((width + kMaxColumns - 1) / kMaxColumns, (height + kMaxRows - 1) / kMaxRows);
  columns_ = (width + cell_px_ - 1) / cell_px_;
  const int rows = (height + cell_px_ - 1) / cell_px_;
  std::fill(grid_.begin(), grid_.begin() + columns_ * rows, kEmpty);
  for (std::size_t i = 0; i < size_; ++i) {
    const Patch& patch = set.patches[order_[i]];
    const int u_end = std::min(patch.u_px + patch.width_px, width);
    const int v_end = std::min(patch.v_px + patch.height_px, height);
    const int first = patch.u_px / cell_px_;
    const int last = (u_end + cell_px_ - 1) / cell_px_;
    for (int row = patch.v_px / cell_px_; row * cell_px_ < v_end; ++row) {
      std::fill(grid_.begin() + row * columns_ + first, grid_.begin() + row * columns_ + last,
                static_cast<std::uint16_t>(i));
    }
  }
}

}  // namespace maplet
