// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/patches/refiner.hpp"

#include <algorithm>
#include <array>
#include <cstring>

namespace maplet {

namespace {

/// Cells without a plane are asked ring by ring: this many cells from the nearest plane.
constexpr int kRings = 2;
/// A cell that a large plane keeps without a look, but for its fit: another plane is next to it.
constexpr std::uint8_t kKept = 0xFF;
/// What is looked at between two looks at the clock.
constexpr int kPixelsPerLook = 1024;
/// A plane goes on into the next ring when it has one in so many of the cell's pixels.
constexpr int kReachShare = 8;
/// Planes with more of the image than this have enough in cells that are all theirs.
constexpr double kSmallPlaneShare = 0.02;
/// A plane is fitted again when it keeps this share of its pixels without the doubtful ones.
constexpr double kLeastCollected = 0.4;
/// Beyond so many standard deviations a pixel is not on a plane.
constexpr double kPixelSigmas = 3.0;

/// The pixels of a row of a block that have a name; the others become 0.
void pick(const std::uint16_t* raw, const std::uint8_t* labels, std::uint8_t name,
          std::uint16_t* out) noexcept {
  using U16x8 = std::uint16_t __attribute__((vector_size(16)));
  using U8x8 = std::uint8_t __attribute__((vector_size(8)));
  U16x8 pixels;
  U8x8 names;
  std::memcpy(&pixels, raw, sizeof pixels);
  std::memcpy(&names, labels, sizeof names);
  const U16x8 wide = __builtin_convertvector(names, U16x8);
  pixels &= wide == (U16x8{} + name);
  std::memcpy(out, &pixels, sizeof pixels);
}

}  // namespace

Refiner::Refiner(Arena& arena)
    : assign_{best_assign_function()},
      sum_{block_variants().back().sum},
      plane_of_cell_{arena.make_array<std::uint8_t>(kMaxFrameCells, "patches/plane of cell")},
      looked_{arena.make_array<std::uint8_t>(kMaxFrameCells, "patches/border cells")},
      nearby_{arena.make_array<std::uint8_t>(kMaxFrameCells * kMaxNearby, "patches/nearby planes")},
      reach_{arena.make_array<std::uint8_t>(3 * kMaxFrameCells + 16, "patches/reach")},
      pixel_planes_{
          arena.make_array<std::uint8_t>(kMaxWidthPx * kMaxHeightPx, "patches/pixel labels")},
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
  for (Candidate& plane : planes()) plane.pixels = plane.before;
  for (int ring = 0; ring < kRings; ++ring) {
    if (look_along_borders(ring, deadline) == Stop::kDeadline) return Stop::kDeadline;
    if (ring > 0 || !bury()) continue;
    if (look_along_borders(ring, deadline) == Stop::kDeadline) return Stop::kDeadline;
  }
  return refit(deadline);
}

Stop Refiner::look_along_borders(int ring, Deadline deadline) noexcept {
  std::uint8_t names[kMaxNearby];
  const auto large = static_cast<std::uint32_t>(kSmallPlaneShare * width_px_ * height_px_);
  // Of large cells after each, of small ones after some.
  const int looks = std::max(1, kPixelsPerLook / (cell_px_ * cell_px_));
  int left = looks;
  if (deadline.expired()) return Stop::kDeadline;
  for (int j = 0; j < high_; ++j) {
    for (int i = 0; i < wide_; ++i) {
      const int cell = j * wide_ + i;
      if (looked_[cell] != 0 || (ring > 0 && plane_of_cell_[cell] != kNone)) continue;
      if (uniform(i, j)) continue;
      // A whole cell that is flat with a large plane is none that a sliver has taken.
      if (plane_of_cell_[cell] != kNone && planes_[plane_of_cell_[cell]].before > large) {
        looked_[cell] = kKept;
        continue;
      }
      const int count = nearby(i, j, names);
      if (count == 0 || (count == 1 && plane_of_cell_[cell] == names[0])) continue;
      if (pyramid_->at(Pyramid::kCellLevel, i, j).pixels == 0) continue;
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
  std::array<std::uint64_t, 4> seen{0, 0, 0, std::uint64_t{1} << 63};  // kNone is no plane
  const std::uint8_t* row = reach_.data() + reach_at(i, j) - reach_wide();
  for (int y = 0; y < 3; ++y, row += reach_wide()) {
    for (int x = -1; x <= 1; ++x) {
      std::uint64_t& word = seen[row[x] / 64U];
      const std::uint64_t bit = std::uint64_t{1} << (row[x] % 64U);
      if ((word & bit) != 0 || count == kMaxNearby) continue;
      word |= bit;
      out[count++] = row[x];
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
    linear[c] = {0.0F, static_cast<float>(plane.fit.a), static_cast<float>(plane.fit.b),
                 static_cast<float>(1.0 / (kPixelSigmas * plane.noise_steps)), names[c]};
  }
  for (int v = j * cell_px_; v < end_v; v += kBlockPx) {
    for (int u = i * cell_px_; u < end_u; u += kBlockPx) {
      for (int c = 0; c < count; ++c) {
        linear[c].corner =
            static_cast<float>(planes_[names[c]].fit.at(u - width_px_ / 2, v - height_px_ / 2));
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
  for (int c = 0; c < count; ++c) planes_[names[c]].pixels += won[c];
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

Stop Refiner::refit(Deadline deadline) noexcept {
  for (Candidate& plane : planes()) {
    plane.collected = {};
  }
  for (int j = 0; j < high_; ++j) {
    for (int i = 0; i < wide_; ++i) {
      const int cell = j * wide_ + i;
      if (looked_[cell] != 0 || plane_of_cell_[cell] == kNone) continue;
      planes_[plane_of_cell_[cell]].collected += pyramid_->at(Pyramid::kCellLevel, i, j).moments;
    }
  }
  for (Candidate& plane : planes()) {
    plane.small = plane.alive && plane.collected.n < kSmallPlaneShare * width_px_ * height_px_;
  }
  for (int j = 0; j < high_; ++j) {
    if (deadline.expired()) return Stop::kDeadline;  // the planes stay what they were
    for (int i = 0; i < wide_; ++i) {
      const int cell = j * wide_ + i;
      if (looked_at(cell)) {
        collect(i, j, nearby_.data() + cell * kMaxNearby, looked_[cell]);
      }
    }
  }
  for (Candidate& plane : planes()) {
    if (!plane.alive || plane.collected.n < kLeastCollected * plane.moments.n) continue;
    const Fit f = maplet::fit(plane.collected);
    if (!f.ok) continue;
    plane.fit = f;
    plane.moments = plane.collected;
  }
  return Stop::kConverged;
}

unsigned Refiner::distinct_quarters(int i, int j, const std::uint8_t* names, int count,
                                    int c) const noexcept {
  const Fit& own = planes_[names[c]].fit;
  const double u = (i + 0.5) * cell_px_ - width_px_ / 2, v = (j + 0.5) * cell_px_ - height_px_ / 2;
  const double w = own.at(u, v), limit = 2.0 * limit_steps_, half = 0.5 * cell_px_;
  unsigned out = 0xF;
  for (int k = 0; k < count && out != 0; ++k) {
    if (k == c) continue;
    const Fit& other = planes_[names[k]].fit;
    const double a = 0.5 * half * (own.a - other.a), b = 0.5 * half * (own.b - other.b);
    const double slack = std::abs(a) + std::abs(b);
    const double middle = w - other.at(u, v);
    if (std::abs(middle) > limit + 2.0 * slack) continue;
    const double quarters[4] = {middle - a - b, middle + a - b, middle - a + b, middle + a + b};
    for (unsigned q = 0; q < 4; ++q) {
      if (std::abs(quarters[q]) <= limit + slack) out &= ~(1U << q);
    }
  }
  return out == 0xF || cell_px_ == kBlockPx ? out : 0U;  // of larger cells all or nothing
}

void Refiner::collect(int i, int j, const std::uint8_t* names, int count) noexcept {
  for (int c = 0; c < count; ++c) {
    if (!planes_[names[c]].small) continue;
    const unsigned quarters = distinct_quarters(i, j, names, count, c);
    if (quarters == 0) continue;
    Moments moments = moments_of(i, j, names[c], quarters);
    if (moments.n == 0.0) continue;
    pyramid_->weigh(moments);
    planes_[names[c]].collected += moments;
  }
}

Moments Refiner::moments_of(int i, int j, std::uint8_t name, unsigned quarters) const noexcept {
  const int end_u = std::min(width_px_, (i + 1) * cell_px_);
  const int end_v = std::min(height_px_, (j + 1) * cell_px_);
  Moments moments;
  for (int v = j * cell_px_; v < end_v; v += kBlockPx) {
    for (int u = i * cell_px_; u < end_u; u += kBlockPx) {
      const int columns = std::min(kBlockPx, end_u - u);
      const int rows = std::min(kBlockPx, end_v - v);
      std::uint16_t own[kBlockPx * kBlockPx];
      for (int y = 0; y < rows; ++y) {
        const std::uint16_t* raw = frame_->depth.row(v + y) + u;
        const std::uint8_t* label = pixel_planes_.data() + (v + y) * width_px_ + u;
        std::uint16_t* row = own + y * kBlockPx;
        if (columns == kBlockPx) {
          pick(raw, label, name, row);
        } else {
          for (int x = 0; x < kBlockPx; ++x) {
            row[x] = x < columns && label[x] == name ? raw[x] : std::uint16_t{0};
          }
        }
        const unsigned halves = quarters >> (y / (kBlockPx / 2) * 2);
        if ((halves & 1U) == 0) std::fill_n(row, kBlockPx / 2, std::uint16_t{0});
        if ((halves & 2U) == 0) std::fill_n(row + kBlockPx / 2, kBlockPx / 2, std::uint16_t{0});
      }
      BlockSums sums;
      sum_(own, kBlockPx, rows, 1, scale_, &sums);
      if (sums.valid != 0) moments += sums.moments(u - width_px_ / 2, v - height_px_ / 2, 1);
    }
  }
  return moments;
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
