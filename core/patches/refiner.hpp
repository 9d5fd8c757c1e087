// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/base/deadline.hpp"
#include "core/frame/depth_frame.hpp"
#include "core/frame/image_size.hpp"
#include "core/limits.hpp"
#include "core/patches/assign.hpp"
#include "core/patches/moments.hpp"
#include "core/patches/pyramid.hpp"

namespace maplet {

/// A plane during the second look.
struct Candidate {
  Fit fit;
  Moments moments;           ///< of the pixels that the fit comes from
  Moments collected = {};    ///< of clean cells, and of border pixels that cannot be others'
  double noise_steps = 1.0;  ///< standard deviation of a pixel, measured inside its cells
  std::uint32_t before = 0;  ///< pixels of its cells
  std::uint32_t pixels = 0;  ///< after the look
  bool alive = true;         ///< false: other planes explain most of its pixels better
  bool small = false;        ///< needs its border pixels for the fit too
  // What the look asks of it for each pixel: 1/Z at the image's middle, and per pixel.
  double w = 0.0, per_u = 0.0, per_v = 0.0;
  float per_limit = 0.0F;  ///< 1 / the distance from which on a pixel does not belong to it
};

/// The second look: pixels of cells where planes end go to the adjacent plane that explains them
/// best, or to none. A plane that loses most of its own pixels this way was none (a sliver along a
/// crease); the others are fitted again to all they have.
///
/// Memory   fixed, from the arena: a byte a pixel, and a few a cell.
/// Time     O(pixels of border cells), vectorised; overruns its deadline by one cell, or 1024 px
///          of them.
/// Threads  one at a time.
/// Math     docs/math/patches.md, eq. 15
class Refiner {
 public:
  static constexpr std::uint8_t kNone = 0xFF;
  static constexpr std::size_t kMaxCandidates = 250;

  Refiner(const ImageSize& largest, Arena& arena);

  /// Starts a frame. name_cell(), hint_cell() and planes() are then the caller's to fill.
  void begin(const Pyramid& pyramid, std::size_t planes) noexcept;
  /// Gives a plane's index to cells of a row of cells.
  void name_cells(int i, int j, int count, std::uint8_t plane) noexcept {
    std::fill_n(plane_of_cell_.begin() + j * wide_ + i, count, plane);
    std::fill_n(reach_.begin() + reach_at(i, j), count, plane);
  }
  /// A part of a cell without plane belongs to this one.
  void hint_cell(int i, int j, std::uint8_t plane) noexcept { reach_[reach_at(i, j)] = plane; }
  [[nodiscard]] std::span<Candidate> planes() noexcept { return planes_.first(plane_count_); }

  /// @param least_pixels  a plane with fewer is none
  Stop run(const DepthFrame& frame, const Pyramid& pyramid, std::uint32_t least_pixels,
           Deadline deadline) noexcept;

  /// Says under which number a plane leaves; kNone: not at all.
  void rename(std::size_t plane, std::uint8_t name) noexcept { names_[plane] = name; }
  /// Name of each pixel with a return plus 1; 0 = none.
  void write_labels(const DepthFrame& frame, std::span<std::uint16_t> out) const noexcept;
  /// No frame: no labels.
  void forget() noexcept { wide_ = high_ = 0; }

 private:
  static constexpr int kMaxNearby = kMaxAssigned;
  /// A cell that its plane keeps without a look.
  static constexpr std::uint8_t kKept = 0xFF;

  Stop look_along_borders(int ring, Deadline deadline) noexcept;
  [[nodiscard]] bool bury() noexcept;
  // reach_ has a border of cells without plane all round, and a byte to read beyond.
  [[nodiscard]] int reach_wide() const noexcept { return wide_ + 2; }
  [[nodiscard]] int reach_at(int i, int j) const noexcept { return (j + 1) * reach_wide() + i + 1; }
  [[nodiscard]] std::size_t reach_size() const noexcept {
    return static_cast<std::size_t>(reach_wide() * (high_ + 2) + 1);
  }
  /// A cell and its eight neighbours have one plane, or none.
  [[nodiscard]] bool uniform(int i, int j) const noexcept;
  [[nodiscard]] int nearby(int i, int j, std::uint8_t* out) const noexcept;
  [[nodiscard]] bool looked_at(int cell) const noexcept {
    return looked_[cell] != 0 && looked_[cell] <= kMaxNearby;
  }
  void look(int i, int j, const std::uint8_t* names, int count) noexcept;
  Stop refit(Deadline deadline) noexcept;
  /// Where plane c is far from the others, so that its pixels cannot be theirs: a bit for each
  /// quarter of a cell.
  [[nodiscard]] unsigned distinct_quarters(int i, int j, const std::uint8_t* names, int count,
                                           int c) const noexcept;
  /// Of a plane's pixels in quarters of a cell.
  [[nodiscard]] Moments moments_of(int i, int j, std::uint8_t name,
                                   unsigned quarters) const noexcept;
  /// A flat cell whose plane is far from all others there: none of its pixels could go to them.
  [[nodiscard]] bool keeps(int i, int j, const std::uint8_t* names, int count) const noexcept;
  void collect(int i, int j, const std::uint8_t* names, int count) noexcept;

  AssignFunction assign_;
  BlockRowFunction sum_;
  std::span<std::uint8_t> plane_of_cell_;
  /// At a cell: planes that its pixels could go to, 0 = not, 255 = kept whole by its plane.
  std::span<std::uint8_t> looked_;
  std::span<std::uint8_t> nearby_;  ///< of a cell: which, kMaxNearby each
  std::span<std::uint8_t> won_;     ///< of a cell: a bit for each of them that got a pixel
  std::span<std::uint8_t> reach_;   ///< the same; of a cell without: the one its pixels found
  std::span<std::uint8_t> pixel_planes_;
  std::span<Candidate> planes_;
  std::span<std::uint8_t> names_;
  std::size_t plane_count_ = 0;
  const DepthFrame* frame_ = nullptr;  ///< during run()
  const Pyramid* pyramid_ = nullptr;   ///< during run()
  DepthScale scale_;
  float limit_steps_ = 1.0F;
  std::uint32_t least_pixels_ = 0;
  int width_px_ = 0, height_px_ = 0;
  int cell_px_ = 8, wide_ = 0, high_ = 0;
};

}  // namespace maplet
