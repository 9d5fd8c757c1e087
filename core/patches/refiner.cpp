// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/patches/refiner.hpp"

#include <algorithm>
#include <cstring>

namespace maplet {

namespace {

/// Cells without a plane are asked ring by ring: this many cells from the nearest plane.
constexpr int kRings = 2;
/// What is looked at between two looks at the clock.
constexpr int kPixelsPerLook = 1024;
/// A plane goes on into the next ring when it has one in so many of the cell's pixels.
constexpr int kReachShare = 8;
/// Beyond so many standard deviations a pixel is not on a plane.
constexpr double kPixelSigmas = 3.0;

}  // namespace

Refiner::Refiner(const ImageSize& largest, Arena& arena)
    : assign_{best_assign_function()},
      sum_{block_variants().back().sum},
      plane_of_cell_{arena.make_array<std::uint8_t>(kMaxFrameCells, "patches/plane of cell")},
      looked_{arena.make_array<std::uint8_t>(kMaxFrameCells, "patches/border cells")},
      nearby_{arena.make_array<std::uint8_t>(kMaxFrameCells * kMaxNearby, "patches/nearby planes")},
      won_{arena.make_array<std::uint8_t>(kMaxFrameCells, "patches/planes with pixels")},
      reach_{arena.make_array<std::uint8_t>(3 * kMaxFrameCells + 16, "patches/reach")},
      pixel_planes_{arena.make_array<std::uint8_t>(largest.pixels(), "patches/pixel labels")},
      planes_{arena.make_array<Candidate>(kMaxCandidates, "patches/plane candidates")},
      names_{arena.make_array<std::uint8_t>(kNone + 1, "patches/plane names")} {}

void Refiner::begin(const Pyramid& pyramid, std::size_t planes) noexcept {
  wide_ = pyramid.cells_wide();
  high_ = pyramid.cells_high();
  cell_px_ = pyramid.cell_px();
  plane_count_ = planes;
  std::fill_n(looked_.begin(), wide_ * high_, std::uint8_t{0});
  std::fill_n(plane_of_cell_.begin(), wide_ * high_, kNone);
  std::fill_n(reach_.begin(), reach_size(), kNone);
  std::fill(names_.begin(), names_.end(), kNone);
}

Stop Refiner::run(const DepthFrame& frame, const Pyramid& pyramid, std::uint32_t least_pixels,
                  Deadline deadline) noexcept {
  frame_ = &frame;
  pyramid_ = &pyramid;
  scale_ = DepthScale::of(frame.metres_per_unit);
  limit_steps_ = static_cast<float>(kPixelSigmas * pyramid.sigma_steps());
  least_pixels_ = least_pixels;
  width_px_ = frame.depth.width_px;
  height_px_ = frame.depth.height_px;
  for (Candidate& plane : planes()) {
    plane.pixels = plane.before;
    plane.w = plane.fit.at(0.0, 0.0);
    plane.per_u = plane.fit.a;
    plane.per_v = plane.fit.b;
    plane.per_limit = static_cast<float>(1.0 / (kPixelSigmas * plane.noise_steps));
  }
  for (int ring = 0; ring < kRings; ++ring) {
    if (look_along_borders(ring, deadline) == Stop::kDeadline) return Stop::kDeadline;
    if (ring > 0 || !bury()) continue;
    if (look_along_borders(ring, deadline) == Stop::kDeadline) return Stop::kDeadline;
  }
  return refit(deadline);
}

Stop Refiner::look_along_borders(int ring, Deadline deadline) noexcept {
  std::uint8_t names[kMaxNearby];
  // Of large cells after each, of small ones after some.
  const int looks = std::max(1, kPixelsPerLook / (cell_px_ * cell_px_));
  int left = looks;
  if (deadline.expired()) return Stop::kDeadline;
  for (int j = 0; j < high_; ++j) {
    for (int i = 0; i < wide_; ++i) {
      const int cell = j * wide_ + i;
      if (looked_[cell] != 0 || (ring > 0 && plane_of_cell_[cell] != kNone)) continue;
      if (uniform(i, j)) continue;
      const int count = nearby(i, j, names);
      if (count == 0 || (count == 1 && plane_of_cell_[cell] == names[0])) continue;
      if (pyramid_->at(Pyramid::kCellLevel, i, j).pixels == 0) continue;
      if (keeps(i, j, names, count)) {
        looked_[cell] = kKept;
        continue;
      }
      looked_[cell] = static_cast<std::uint8_t>(count);
      std::copy_n(names, count, nearby_.begin() + cell * kMaxNearby);
      look(i, j, names, count);
      if (--left > 0) continue;
      left = looks;
      if (deadline.expired()) return Stop::kDeadline;
    }
  }
  return Stop::kConverged;
}

bool Refiner::bury() noexcept {
  bool any = false;
  for (Candidate& plane : planes()) {
    plane.alive = plane.pixels >= least_pixels_ && 2 * plane.pixels >= plane.before;
    any |= !plane.alive;
  }
  if (!any) return false;
  const auto dead = [&](std::uint8_t plane) { return plane != kNone && !planes_[plane].alive; };
  for (int j = 0; j < high_; ++j) {
    for (int i = 0; i < wide_; ++i) {
      if (!dead(reach_[reach_at(i, j)])) continue;
      const int first = std::max(0, i - 1);
      const int last = std::min(wide_ - 1, i + 1);
      for (int y = std::max(0, j - 1); y <= std::min(high_ - 1, j + 1); ++y) {
        std::fill(looked_.begin() + y * wide_ + first, looked_.begin() + y * wide_ + last + 1,
                  std::uint8_t{0});
      }
    }
  }
  for (int cell = 0; cell < wide_ * high_; ++cell) {
    if (dead(plane_of_cell_[cell])) plane_of_cell_[cell] = kNone;
  }
  for (std::uint8_t& plane : reach_.first(reach_size())) {
    if (dead(plane)) plane = kNone;
  }
  return true;
}

bool Refiner::uniform(int i, int j) const noexcept {
  const std::uint8_t* middle = reach_.data() + reach_at(i, j);
  const std::uint32_t all = *middle * 0x010101U;
  const auto differs = [&](const std::uint8_t* three) {
    std::uint32_t four;  // one more than needed: the next row's first
    std::memcpy(&four, three - 1, sizeof four);
    return (four ^ all) & 0xFFFFFFU;
  };
  return (differs(middle - reach_wide()) | differs(middle) | differs(middle + reach_wide())) == 0;
}

int Refiner::nearby(int i, int j, std::uint8_t* out) const noexcept {
  int count = 0;
  std::uint8_t last = kNone;  // most neighbours are what the one before was
  const std::uint8_t* row = reach_.data() + reach_at(i, j) - reach_wide();
  for (int y = 0; y < 3; ++y, row += reach_wide()) {
    for (int x = -1; x <= 1; ++x) {
      if (row[x] == last || row[x] == kNone) continue;
      last = row[x];
      if (std::find(out, out + count, last) == out + count && count < kMaxNearby) {
        out[count++] = last;
      }
    }
  }
  return count;
}

void Refiner::look(int i, int j, const std::uint8_t* names, int count) noexcept {
  const int cell = j * wide_ + i;
  const int end_u = std::min(width_px_, (i + 1) * cell_px_);
  const int end_v = std::min(height_px_, (j + 1) * cell_px_);
  std::uint32_t won[kMaxNearby] = {};
  LinearDepth linear[kMaxNearby];
  for (int c = 0; c < count; ++c) {
    const Candidate& plane = planes_[names[c]];
    linear[c] = {0.0F, static_cast<float>(plane.per_u), static_cast<float>(plane.per_v),
                 plane.per_limit, names[c]};
  }
  for (int v = j * cell_px_; v < end_v; v += kBlockPx) {
    for (int u = i * cell_px_; u < end_u; u += kBlockPx) {
      for (int c = 0; c < count; ++c) {
        const Candidate& plane = planes_[names[c]];
        linear[c].corner = static_cast<float>(plane.w + plane.per_u * (u - width_px_ / 2) +
                                              plane.per_v * (v - height_px_ / 2));
      }
      const int columns = std::min(kBlockPx, end_u - u);
      const int rows = std::min(kBlockPx, end_v - v);
      const std::uint16_t* pixels = frame_->depth.row(v) + u;
      std::uint8_t* out = pixel_planes_.data() + v * width_px_ + u;
      if (columns == kBlockPx) {
        assign_(pixels, frame_->depth.stride_px, rows, scale_, linear, count, out, width_px_, won);
        continue;
      }
      // The right edge: a full block with nothing beyond it.
      std::uint16_t copy[kBlockPx * kBlockPx] = {};
      std::uint8_t labels[kBlockPx * kBlockPx];
      for (int y = 0; y < rows; ++y) {
        std::memcpy(copy + y * kBlockPx, pixels + y * frame_->depth.stride_px,
                    columns * sizeof *pixels);
      }
      assign_(copy, kBlockPx, rows, scale_, linear, count, labels, kBlockPx, won);
      for (int y = 0; y < rows; ++y) {
        std::memcpy(out + y * width_px_, labels + y * kBlockPx, columns);
      }
    }
  }
  unsigned winners = 0;
  for (int c = 0; c < count; ++c) {
    planes_[names[c]].pixels += won[c];
    if (won[c] != 0) winners |= 1U << c;
  }
  won_[cell] = static_cast<std::uint8_t>(winners);
  const std::uint8_t own = plane_of_cell_[cell];
  if (own != kNone) {
    planes_[own].pixels -= pyramid_->at(Pyramid::kCellLevel, i, j).pixels;
    return;
  }
  if (plane_of_cell_[cell] != kNone) return;
  const auto best = std::max_element(won, won + count);
  if (*best * kReachShare >= static_cast<std::uint32_t>(cell_px_ * cell_px_)) {
    reach_[reach_at(i, j)] = names[best - won];
  }
}

void Refiner::write_labels(const DepthFrame& frame, std::span<std::uint16_t> out) const noexcept {
  const DepthScale scale = DepthScale::of(frame.metres_per_unit);
  const int width = frame.depth.width_px;
  std::size_t k = 0;
  for (int v = 0; v < frame.depth.height_px; ++v) {
    const std::uint16_t* raw = frame.depth.row(v);
    for (int u = 0; u < width; ++u, ++k) {
      out[k] = 0;
      if (wide_ == 0 || !scale.valid(raw[u])) continue;
      const int cell = v / cell_px_ * wide_ + u / cell_px_;
      const std::uint8_t plane = looked_at(cell) ? pixel_planes_[k] : plane_of_cell_[cell];
      if (plane != kNone && names_[plane] != kNone) {
        out[k] = static_cast<std::uint16_t>(names_[plane] + 1);
      }
    }
  }
}

}  // namespace maplet
