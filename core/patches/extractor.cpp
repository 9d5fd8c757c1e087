// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/patches/extractor.hpp"

#include <algorithm>
#include <cmath>

namespace maplet {

namespace {

/// Mean gray of a rectangle, from every second row.
float mean_gray(const ImageView<std::uint8_t>& gray, const Patch& patch) noexcept {
  if (gray.empty()) return -1.0F;
  std::uint32_t sum = 0;
  std::uint32_t count = 0;
  for (int v = patch.v_px; v < patch.v_px + patch.height_px; v += 2) {
    const std::uint8_t* row = gray.row(v) + patch.u_px;
    for (int u = 0; u < patch.width_px; ++u) sum += row[u];
    count += patch.width_px;
  }
  return static_cast<float>(sum) / static_cast<float>(count);
}

}  // namespace

PatchExtractor::PatchExtractor(const PatchConfig& config, Arena& arena)
    : config_{config},
      pyramid_{config, arena},
      tree_{config, arena},
      merger_{config, arena},
      refiner_{config, arena},
      plane_of_region_{arena.make_array<std::int16_t>(Merger::kMaxRegions, "patches/numbers")},
      largest_{arena.make_array<std::int16_t>(Merger::kMaxRegions, "patches/order")},
      fits_{arena.make_array<Fit>(kMaxFramePlanes, "patches/fits")},
      out_{arena.make<PatchSet>("patches/result")} {}

const PatchSet& PatchExtractor::run(const DepthFrame& frame, Deadline deadline) noexcept {
  out_->clear();
  out_->camera = frame.camera;
  if (!frame.camera.valid()) {
    refiner_.forget();
    return *out_;
  }
  pixel_frame_ = PixelFrame{frame.camera};
  correlated_px_ = std::max(1.0, frame.noise.correlated_px);

  const bool seen = pyramid_.fill(frame, deadline);
  out_->valid_pixels = pyramid_.valid_pixels();
  const Stop split = tree_.run(pyramid_, frame.camera, correlated_px_, deadline);
  const Stop merge = merger_.run(pyramid_, tree_, correlated_px_, deadline);
  number_planes();
  emit_planes(frame);
  emit_patches(frame);
  Stop look = Stop::kConverged;
  name_cells();
  if (config_.second_look) {
    look = refiner_.run(frame, pyramid_, fits_.first(out_->planes.size()), deadline);
  } else {
    refiner_.skip(pyramid_);
  }
  out_->stop = !seen ? Stop::kDeadline : std::max({split, merge, look});
  return *out_;
}

void PatchExtractor::number_planes() noexcept {
  const std::span<const Region> regions = merger_.regions();
  std::size_t count = 0;
  for (std::size_t r = 0; r < regions.size(); ++r) {
    plane_of_region_[r] = Patch::kNoPlane;
    if (regions[r].merged_into < 0) largest_[count++] = static_cast<std::int16_t>(r);
  }
  const auto larger = [&](std::int16_t a, std::int16_t b) {
    return regions[a].pixels != regions[b].pixels ? regions[a].pixels > regions[b].pixels : a < b;
  };
  std::sort(largest_.begin(), largest_.begin() + static_cast<std::ptrdiff_t>(count), larger);
  count = std::min(count, kMaxFramePlanes);
  for (std::size_t p = 0; p < count; ++p)
    plane_of_region_[largest_[p]] = static_cast<std::int16_t>(p);
  out_->planes.resize(count);
}

Eigen::Matrix3d PatchExtractor::information(const Moments& moments, double rss) const noexcept {
  const double sigma = pyramid_.sigma_steps() / kInverseDepthSteps;
  const double model = sigma * sigma;
  const double measured = rss / (moments.n * kInverseDepthSteps * kInverseDepthSteps);
  return pixel_frame_.normal_matrix(moments) / (std::max(model, measured) * correlated_px_);
}

void PatchExtractor::emit_planes(const DepthFrame&) noexcept {
  for (std::size_t p = 0; p < out_->planes.size(); ++p) {
    const Region& region = merger_.regions()[largest_[p]];
    const Fit f = fits_[p] = fit(region.moments);
    FramePlane& plane = out_->planes[p];
    plane.theta = pixel_frame_.theta(f);
    plane.information = information(region.moments, f.rss);
    plane.pixels = region.pixels;
    plane.area_m2 = 0.0F;
    // Distance to the plane is d Z times the residual of 1/Z (eq. 14).
    const double rms = std::sqrt(f.rss / region.moments.n) / kInverseDepthSteps;
    plane.rms_m = static_cast<float>(rms * kInverseDepthSteps / (f.w0 * plane.theta.norm()));
    plane.mean_gray = -1.0F;
  }
}

void PatchExtractor::name_cells() noexcept {
  const std::span<std::uint8_t> cells = refiner_.cells();
  const PatchGrid& grid = out_->cells;
  for (int k = 0; k < grid.width * grid.height; ++k) {
    const std::int16_t patch = grid.patch[k];
    const std::int16_t plane = patch < 0 ? Patch::kNoPlane : out_->patches[patch].plane;
    cells[k] = plane < 0 ? Refiner::kNone : static_cast<std::uint8_t>(plane);
  }
}

void PatchExtractor::emit_patches(const DepthFrame& frame) noexcept {
  PatchGrid& grid = out_->cells;
  grid.cell_px = static_cast<std::uint16_t>(pyramid_.cell_px());
  grid.width = static_cast<std::uint16_t>(pyramid_.cells_wide());
  grid.height = static_cast<std::uint16_t>(pyramid_.cells_high());
  std::fill_n(grid.patch.begin(), grid.width * grid.height, PatchGrid::kNone);
  const double sigma = pyramid_.sigma_steps();
  const double pixel_area = std::abs(pixel_frame_.inv_fx * pixel_frame_.inv_fy);
  double gray_sum[kMaxFramePlanes] = {};
  for (const Leaf& leaf : tree_.leaves()) {
    const int region = merger_.resolve(leaf.region);
    const std::int16_t plane = region < 0 ? Patch::kNoPlane : plane_of_region_[region];
    // A lone finest cell that no neighbour agrees with often straddles an edge: do not believe it.
    if (plane == Patch::kNoPlane && leaf.level == 0) continue;
    const PyramidNode& node = pyramid_.at(leaf.level, leaf.i, leaf.j);
    const Fit f = fit(node.moments);
    const int edge = pyramid_.cell_px() << leaf.level;
    const auto index = static_cast<std::int16_t>(out_->patches.size());
    Patch& patch = out_->patches.emplace_back();
    patch.theta = pixel_frame_.theta(f);
    patch.information = information(node.moments, f.rss);
    patch.ray = pixel_frame_.ray(f.u0, f.v0);
    patch.u_px = static_cast<std::uint16_t>(leaf.i * edge);
    patch.v_px = static_cast<std::uint16_t>(leaf.j * edge);
    patch.width_px = static_cast<std::uint16_t>(std::min(edge, frame.depth.width_px - patch.u_px));
    patch.height_px =
        static_cast<std::uint16_t>(std::min(edge, frame.depth.height_px - patch.v_px));
    patch.pixels = node.pixels;
    patch.rms = static_cast<float>(std::sqrt(f.rss / node.moments.n) / sigma);
    patch.mean_gray = mean_gray(frame.gray, patch);
    patch.plane = plane;
    out_->covered_pixels += node.pixels;
    if (plane != Patch::kNoPlane) {
      FramePlane& whole = out_->planes[plane];
      const double z = kInverseDepthSteps / f.w0;
      whole.area_m2 +=
          static_cast<float>(node.pixels * pixel_area * whole.theta.norm() * z * z * z);  // eq. 15
      gray_sum[plane] += static_cast<double>(patch.mean_gray) * node.pixels;
    }
    const int cells = 1 << leaf.level;
    for (int j = leaf.j * cells; j < std::min<int>((leaf.j + 1) * cells, grid.height); ++j) {
      for (int i = leaf.i * cells; i < std::min<int>((leaf.i + 1) * cells, grid.width); ++i) {
        grid.patch[j * grid.width + i] = index;
      }
    }
  }
  if (!frame.gray.empty()) {
    for (std::size_t p = 0; p < out_->planes.size(); ++p) {
      out_->planes[p].mean_gray = static_cast<float>(gray_sum[p] / out_->planes[p].pixels);
    }
  }
}

}  // namespace maplet
