// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The planes of the second look fitted again: which pixels can only be one plane's.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/patches/refiner.hpp"

namespace maplet {

namespace {

/// Planes with more of the image than this have enough in cells that are all theirs.
constexpr double kSmallPlaneShare = 0.02;
/// A plane is fitted again when it keeps this share of its pixels without the doubtful ones.
constexpr double kLeastCollected = 0.4;

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
      if (looked_[cell] == kKept) {
        Candidate& plane = planes_[plane_of_cell_[cell]];
        if (plane.small) plane.collected += pyramid_->at(Pyramid::kCellLevel, i, j).moments;
      } else if (looked_[cell] != 0) {
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

bool Refiner::keeps(int i, int j, const std::uint8_t* names, int count) const noexcept {
  const std::uint8_t own = plane_of_cell_[j * wide_ + i];
  const auto at = std::find(names, names + count, own) - names;
  return at < count && distinct_quarters(i, j, names, count, static_cast<int>(at)) == 0xF;
}

void Refiner::collect(int i, int j, const std::uint8_t* names, int count) noexcept {
  for (int c = 0; c < count; ++c) {
    if ((won_[j * wide_ + i] >> c & 1U) == 0 || !planes_[names[c]].small) continue;
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

}  // namespace maplet
