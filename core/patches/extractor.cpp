// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/patches/extractor.hpp"

#include <algorithm>
#include <cmath>

namespace maplet {

namespace {

/// A gray image of another size than the depth image is not its own.
bool has_gray(const DepthFrame& frame) noexcept {
  return !frame.gray.empty() && frame.gray.width_px == frame.depth.width_px &&
         frame.gray.height_px == frame.depth.height_px;
}

/// Mean gray of a rectangle, from every second row.
float mean_gray(const DepthFrame& frame, const Patch& patch) noexcept {
  if (!has_gray(frame)) return -1.0F;
  const ImageView<std::uint8_t>& gray = frame.gray;
  std::uint32_t sum = 0;
  std::uint32_t count = 0;
  for (int v = patch.v_px; v < patch.v_px + patch.height_px; v += 2) {
    const std::uint8_t* row = gray.row(v) + patch.u_px;
    for (int u = 0; u < patch.width_px; ++u) sum += row[u];
    count += patch.width_px;
  }
  return static_cast<float>(sum) / static_cast<float>(count);
}

/// A plane that looks smoother than this share of the noise model has been lucky.
constexpr double kLeastNoise = 0.4;

/// Intrinsics beyond these are no camera's, and their squares would leave the range of a double.
constexpr double kLeastFocalPx = 1e-3;
constexpr double kMostPx = 1e9;
constexpr double kMostCorrelatedPx = 1e4;

bool usable(const DepthFrame& frame) noexcept {
  const CameraModel& c = frame.camera;
  const auto focal = [](double f) {
    return std::abs(f) >= kLeastFocalPx && std::abs(f) <= kMostPx;
  };
  return c.valid() && c.width_px == frame.depth.width_px && c.height_px == frame.depth.height_px &&
         focal(c.fx_px) && focal(c.fy_px) && std::abs(c.cx_px) <= kMostPx &&
         std::abs(c.cy_px) <= kMostPx;
}

/// Residual between cells that noise explains, in standard deviations of its sum.
constexpr double kChanceSigmas = 2.0;
/// Of the misfit beyond that, what goes into the fit: measured on simulated rooms and boxes.
constexpr double kMisfitShare = 0.1;

/// Eq. 19: what is left over beyond chance is no noise but a surface that is not quite this plane;
/// it does not average out over its pixels.
double misfit(double explained, double dof, double noise_power) noexcept {
  return std::max(0.0, explained - noise_power * (dof + kChanceSigmas * std::sqrt(2.0 * dof)));
}

constexpr double kSquaredSteps = kInverseDepthSteps * kInverseDepthSteps;

}  // namespace

PatchExtractor::PatchExtractor(const PatchConfig& config, Arena& arena, const ImageSize& largest)
    : config_{config},
      pyramid_{config, largest, arena},
      tree_{config, arena},
      merger_{config, arena},
      refiner_{largest, arena},
      candidate_of_region_{arena.make_array<std::int16_t>(Merger::kMaxRegions, "patches/numbers")},
      largest_{arena.make_array<std::int16_t>(Merger::kMaxRegions, "patches/order")},
      plane_of_candidate_{
          arena.make_array<std::int16_t>(Refiner::kMaxCandidates, "patches/plane numbers")},
      tally_{arena.make_array<Tally>(kMaxFramePlanes, "patches/tally")},
      out_{arena.make<PatchSet>("patches/result")} {}

const PatchSet& PatchExtractor::run(const DepthFrame& frame, Deadline deadline) noexcept {
  out_->clear();
  out_->camera = frame.camera;
  refiner_.forget();
  if (!usable(frame)) return *out_;
  pixel_frame_ = PixelFrame{frame.camera};
  correlated_px_ = std::clamp(frame.noise.correlated_px, 1.0, kMostCorrelatedPx);
  if (!(frame.noise.correlated_px >= 1.0)) correlated_px_ = 1.0;  // NaN too

  const Plan when = plan(frame, deadline);
  const int cell_px = pyramid_.finest(frame.depth.width_px, frame.depth.height_px).cell_px;
  const auto least = static_cast<std::uint32_t>(config_.min_plane_cells * cell_px * cell_px);
  const bool seen = pyramid_.fill(frame, when.grain, when.fill) && when.finest;
  out_->valid_pixels = pyramid_.valid_pixels();
  const Stop split = tree_.run(pyramid_, frame.camera, correlated_px_, when.split);
  const Stop merge = merger_.run(pyramid_, tree_, correlated_px_, least, when.merge);
  step_bias_ = StepBias{frame.noise.disparity_step * kInverseDepthSteps, tree_.pixel_variance(),
                        frame.metres_per_unit};
  nominate_planes();
  name_cells();
  const Stop look = config_.second_look
                        ? refiner_.run(frame, pyramid_, least, before_writing(deadline))
                        : Stop::kConverged;
  emit_planes();
  emit_patches(frame, deadline);
  finish_planes(frame);
  out_->stop = !seen ? Stop::kDeadline : std::max({split, merge, look});
  return *out_;
}

void PatchExtractor::nominate_planes() noexcept {
  const std::span<const Region> regions = merger_.regions();
  std::size_t count = 0;
  for (std::size_t r = 0; r < regions.size(); ++r) {
    candidate_of_region_[r] = Patch::kNoPlane;
    if (regions[r].merged_into < 0) largest_[count++] = static_cast<std::int16_t>(r);
  }
  const auto larger = [&](std::int16_t a, std::int16_t b) {
    return regions[a].pixels != regions[b].pixels ? regions[a].pixels > regions[b].pixels : a < b;
  };
  std::sort(largest_.begin(), largest_.begin() + static_cast<std::ptrdiff_t>(count), larger);
  candidate_count_ = std::min(count, Refiner::kMaxCandidates);
  refiner_.begin(pyramid_, candidate_count_);
  for (std::size_t c = 0; c < candidate_count_; ++c) {
    const Region& region = regions[largest_[c]];
    candidate_of_region_[largest_[c]] = static_cast<std::int16_t>(c);
    // Of n pixels a cell's own plane takes three degrees of freedom.
    const double dof = std::max(1.0, region.moments.n - 3.0 * region.cells);
    const Fit f = fit(region.moments);
    const double sigma = std::sqrt(pyramid_.variance(f));
    refiner_.planes()[c] = {
        .fit = f,
        .moments = region.moments,
        .noise_steps = std::clamp(std::sqrt(region.cells_rss / dof), kLeastNoise * sigma, sigma),
        .before = region.pixels,
        .pixels = region.pixels};
  }
}

std::int16_t PatchExtractor::candidate_of(const Leaf& leaf) const noexcept {
  const int region = merger_.resolve(leaf.region);
  return region < 0 ? Patch::kNoPlane : candidate_of_region_[region];
}

void PatchExtractor::name_cells() noexcept {
  const int wide = pyramid_.cells_wide();
  const int high = pyramid_.cells_high();
  for (const Leaf& leaf : tree_.leaves()) {
    const std::int16_t candidate = candidate_of(leaf);
    if (candidate < 0) continue;
    const auto name = static_cast<std::uint8_t>(candidate);
    if (leaf.level < Pyramid::kCellLevel) {
      refiner_.hint_cell(leaf.i / 2, leaf.j / 2, name);
      continue;
    }
    const int edge = 1 << (leaf.level - Pyramid::kCellLevel);
    const int i = leaf.i * edge;
    for (int j = leaf.j * edge; j < std::min((leaf.j + 1) * edge, high); ++j) {
      refiner_.name_cells(i, j, std::min(edge, wide - i), name);
    }
  }
}

Eigen::Matrix3d PatchExtractor::information(const Moments& moments,
                                            double noise_power) const noexcept {
  return pixel_frame_.normal_matrix(moments) * (kSquaredSteps / noise_power);
}

void PatchExtractor::emit_planes() noexcept {
  for (std::size_t c = 0; c < candidate_count_; ++c) {
    plane_of_candidate_[c] = Patch::kNoPlane;
    if (!refiner_.planes()[c].alive || out_->planes.size() == kMaxFramePlanes) continue;
    plane_of_candidate_[c] = static_cast<std::int16_t>(out_->planes.size());
    refiner_.rename(c, static_cast<std::uint8_t>(out_->planes.size()));
    emit_plane(c);
  }
}

void PatchExtractor::emit_plane(std::size_t candidate) noexcept {
  const Candidate& from = refiner_.planes()[candidate];
  const Region& region = merger_.regions()[largest_[candidate]];
  FramePlane& plane = out_->planes.emplace_back();
  plane.theta = pixel_frame_.theta(from.fit);
  // Eq. 14: how far the cells' own planes are from the whole one tells the noise's power at low
  // frequencies, correlation and distortion included; the model is the prior.
  const double prior = tree_.correlated_px() * pyramid_.variance(from.fit);
  const double explained = std::max(0.0, region.rss - region.cells_rss);
  const double dof = 3.0 * std::max(0.0, static_cast<double>(region.cells) - 1.0);
  constexpr double kPriorDof = 12.0;
  const double bands = step_bias_.power(from.fit.w0) * region.moments.n;
  const double power = (kPriorDof * prior + explained) / (kPriorDof + dof) +
                       kMisfitShare * misfit(explained - bands, dof, prior) +
                       step_bias_.residue(from.fit.w0) * from.moments.n;
  plane.information = information(from.moments, power);
  tally_[out_->planes.size() - 1] = {.from = &from,
                                     .noise_power = power,
                                     .waves = step_bias_.matters(from.fit, from.moments, power)};
  plane.pixels = from.pixels;
  plane.area_m2 = 0.0F;
  // Distance to the plane is d Z times the residual of 1/Z (eq. 16).
  const double rms = std::sqrt(from.fit.rss / from.moments.n);
  plane.rms_m = static_cast<float>(rms / (from.fit.w0 * plane.theta.norm()));
  plane.mean_gray = -1.0F;
}

void PatchExtractor::emit_patches(const DepthFrame& frame, Deadline deadline) noexcept {
  PatchGrid& grid = out_->cells;
  grid.cell_px = static_cast<std::uint16_t>(pyramid_.cell_px());
  grid.width = static_cast<std::uint16_t>(pyramid_.cells_wide());
  grid.height = static_cast<std::uint16_t>(pyramid_.cells_high());
  std::fill_n(grid.patch.begin(), grid.width * grid.height, PatchGrid::kNone);
  for (const Leaf& leaf : tree_.leaves()) {
    if (leaf.level < Pyramid::kCellLevel) continue;
    const std::int16_t candidate = candidate_of(leaf);
    const std::int16_t plane = candidate < 0 ? Patch::kNoPlane : plane_of_candidate_[candidate];
    // A lone cell that no neighbour agrees with often straddles an edge: do not believe it.
    if (plane == Patch::kNoPlane && leaf.level == Pyramid::kCellLevel) continue;
    if (out_->patches.size() % 16 == 15 && deadline.expired()) break;
    emit_patch(leaf, plane, frame);
  }
}

void PatchExtractor::finish_planes(const DepthFrame& frame) noexcept {
  const bool gray = has_gray(frame);
  for (std::size_t p = 0; p < out_->planes.size(); ++p) {
    FramePlane& plane = out_->planes[p];
    const Tally& tally = tally_[p];
    if (tally.waves) {
      step_bias_.weaken(plane.information, tally.noise_power, pixel_frame_, tally.from->fit,
                        tally.from->moments, tally.wave, tally.pixels);
    }
    if (gray) plane.mean_gray = static_cast<float>(tally.gray / std::max(1e-9F, plane.area_m2));
  }
}

double PatchExtractor::patch_noise(const Leaf& leaf, const PyramidNode& node,
                                   const Fit& f) const noexcept {
  const double power = tree_.correlated_px() * pyramid_.variance(f);
  const double explained = leaf.rss - node.cells_rss - step_bias_.power(f.w0) * node.moments.n;
  return power + kMisfitShare * misfit(explained, 3.0 * (node.cells - 1.0), power);
}

void PatchExtractor::emit_patch(const Leaf& leaf, std::int16_t plane,
                                const DepthFrame& frame) noexcept {
  const PyramidNode& node = pyramid_.at(leaf.level, leaf.i, leaf.j);
  const Fit f = leaf.level == Pyramid::kCellLevel ? pyramid_.fit_of(leaf.level, leaf.i, leaf.j)
                                                  : fit(node.moments);
  const int edge = pyramid_.edge_px(leaf.level);
  const auto index = static_cast<std::int16_t>(out_->patches.size());
  Patch& patch = out_->patches.emplace_back();
  patch.theta = pixel_frame_.theta(f);
  const double noise_power = patch_noise(leaf, node, f);
  patch.information = information(node.moments, noise_power);
  if (step_bias_.matters(f, node.moments, noise_power)) {
    StepWave wave;
    step_bias_.add(f, node.moments, edge, edge, wave);
    step_bias_.weaken(patch.information, noise_power, pixel_frame_, f, node.moments, wave,
                      node.moments.n);
  }
  patch.ray = pixel_frame_.ray(f.u0, f.v0);
  patch.u_px = static_cast<std::uint16_t>(leaf.i * edge);
  patch.v_px = static_cast<std::uint16_t>(leaf.j * edge);
  patch.width_px = static_cast<std::uint16_t>(std::min(edge, frame.depth.width_px - patch.u_px));
  patch.height_px = static_cast<std::uint16_t>(std::min(edge, frame.depth.height_px - patch.v_px));
  patch.pixels = node.pixels;
  patch.rms = static_cast<float>(std::sqrt(f.rss / node.moments.n) / pyramid_.sigma_steps());
  patch.mean_gray = mean_gray(frame, patch);
  patch.plane = plane;
  out_->covered_pixels += node.pixels;
  if (plane != Patch::kNoPlane) add_to_plane(patch, node.moments);
  PatchGrid& grid = out_->cells;
  const int cells = 1 << (leaf.level - Pyramid::kCellLevel);
  for (int j = leaf.j * cells; j < std::min<int>((leaf.j + 1) * cells, grid.height); ++j) {
    for (int i = leaf.i * cells; i < std::min<int>((leaf.i + 1) * cells, grid.width); ++i) {
      grid.patch[j * grid.width + i] = index;
    }
  }
}

void PatchExtractor::add_to_plane(const Patch& patch, const Moments& moments) noexcept {
  FramePlane& plane = out_->planes[patch.plane];
  Tally& tally = tally_[patch.plane];
  const double z = kInverseDepthSteps * moments.n / moments.w;
  const double pixel_m2 =
      std::abs(pixel_frame_.inv_fx * pixel_frame_.inv_fy) * plane.theta.norm() * z * z * z;
  const double area = patch.pixels * pixel_m2;  // eq. 17
  plane.area_m2 += static_cast<float>(area);
  tally.gray += static_cast<double>(patch.mean_gray) * area;
  tally.pixels += moments.n;
  if (tally.waves) {
    step_bias_.add(tally.from->fit, moments, patch.width_px, patch.height_px, tally.wave);
  }
}

}  // namespace maplet
