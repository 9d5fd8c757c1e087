// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/patches/refiner.hpp"

#include <algorithm>

#include "core/patches/assign.hpp"

namespace maplet {

namespace {

/// Cells without a plane are asked ring by ring: this many cells from the nearest plane.
constexpr int kRings = 3;
/// A plane goes on into the next ring when it has this share of the cell's pixels.
constexpr int kReachShare = 8;

}  // namespace

Refiner::Refiner(const PatchConfig& config, Arena& arena)
    : config_{config},
      plane_of_cell_{arena.make_array<std::uint8_t>(kMaxFrameCells, "patches/plane of cell")},
      from_pixels_{arena.make_array<std::uint8_t>(kMaxFrameCells, "patches/border cells")},
      reach_{arena.make_array<std::uint8_t>(kMaxFrameCells, "patches/reach")},
      pixel_planes_{
          arena.make_array<std::uint8_t>(kMaxWidthPx * kMaxHeightPx, "patches/pixel labels")} {}

void Refiner::lay_out(const Pyramid& pyramid) noexcept {
  wide_ = pyramid.cells_wide();
  high_ = pyramid.cells_high();
  cell_px_ = pyramid.cell_px();
  std::fill_n(from_pixels_.begin(), wide_ * high_, std::uint8_t{0});
}

void Refiner::skip(const Pyramid& pyramid) noexcept { lay_out(pyramid); }

Stop Refiner::run(const DepthFrame& frame, const Pyramid& pyramid, std::span<const Fit> planes,
                  Deadline deadline) noexcept {
  lay_out(pyramid);
  frame_ = &frame;
  planes_ = planes;
  scale_ = DepthScale::of(frame.metres_per_unit);
  sigma_steps_ = pyramid.sigma_steps();
  width_px_ = frame.depth.width_px;
  height_px_ = frame.depth.height_px;
  std::fill_n(reach_.begin(), wide_ * high_, kNone);
  std::uint8_t names[kMaxCandidates];
  for (int ring = 0; ring < kRings; ++ring) {
    for (int j = 0; j < high_; ++j) {
      if (deadline.expired()) return Stop::kDeadline;
      for (int i = 0; i < wide_; ++i) {
        const int cell = j * wide_ + i;
        if (from_pixels_[cell] != 0 || pyramid.at(0, i, j).pixels == 0) continue;
        if (ring > 0 && plane_of_cell_[cell] != kNone) continue;
        const int count = candidates(i, j, names);
        // Inside one plane there is nothing to look for.
        if (count == 0 || (count == 1 && plane_of_cell_[cell] == names[0])) continue;
        from_pixels_[cell] = static_cast<std::uint8_t>(ring + 1);
        look(i, j, names, count);
      }
    }
  }
  return Stop::kConverged;
}

int Refiner::candidates(int i, int j, std::uint8_t* out) const noexcept {
  int count = 0;
  for (int y = std::max(0, j - 1); y <= std::min(high_ - 1, j + 1); ++y) {
    for (int x = std::max(0, i - 1); x <= std::min(wide_ - 1, i + 1); ++x) {
      const int cell = y * wide_ + x;
      std::uint8_t plane = plane_of_cell_[cell];
      if (plane == kNone) plane = reach_[cell];
      if (plane == kNone || std::find(out, out + count, plane) != out + count) continue;
      if (count < kMaxCandidates) out[count++] = plane;
    }
  }
  return count;
}

void Refiner::look(int i, int j, const std::uint8_t* names, int count) noexcept {
  const int u = i * cell_px_;
  const int v = j * cell_px_;
  const int columns = std::min(cell_px_, width_px_ - u);
  const int rows = std::min(cell_px_, height_px_ - v);
  LinearDepth linear[kMaxCandidates];
  for (int c = 0; c < count; ++c) {
    const Fit& f = planes_[names[c]];
    linear[c] = {static_cast<float>(f.at(u - width_px_ / 2, v - height_px_ / 2)),
                 static_cast<float>(f.a), static_cast<float>(f.b)};
  }
  std::uint32_t won[kMaxCandidates + 1] = {};
  assign_pixels(frame_->depth, u, v, columns, rows, scale_, static_cast<float>(3.0 * sigma_steps_),
                {linear, static_cast<std::size_t>(count)}, names, pixel_planes_.data(), width_px_,
                won);
  const int cell = j * wide_ + i;
  if (plane_of_cell_[cell] != kNone) return;
  const auto best = std::max_element(won, won + count);
  if (*best * kReachShare >= static_cast<std::uint32_t>(columns * rows)) {
    reach_[cell] = names[best - won];
  }
}

std::uint8_t Refiner::plane_at(int u, int v) const noexcept {
  const int cell = v / cell_px_ * wide_ + u / cell_px_;
  return from_pixels_[cell] != 0 ? pixel_planes_[v * width_px_ + u] : plane_of_cell_[cell];
}

void Refiner::write_labels(const DepthFrame& frame, std::span<std::uint16_t> out) const noexcept {
  const DepthScale scale = DepthScale::of(frame.metres_per_unit);
  const int width = frame.depth.width_px;
  std::size_t k = 0;
  for (int v = 0; v < frame.depth.height_px; ++v) {
    for (int u = 0; u < width; ++u, ++k) {
      out[k] = 0;
      if (wide_ == 0 || !scale.valid(frame.depth.at(u, v))) continue;
      const std::uint8_t plane = plane_at(u, v);
      if (plane != kNone) out[k] = static_cast<std::uint16_t>(plane + 1);
    }
  }
}

}  // namespace maplet
