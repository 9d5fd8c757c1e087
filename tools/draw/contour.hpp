// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

namespace maplet::draw {

using Polyline = std::vector<Eigen::Vector2d>;

/// An axis-aligned box, metres.
struct Bounds {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(1e30);
  Eigen::Vector2d high = Eigen::Vector2d::Constant(-1e30);

  [[nodiscard]] bool empty() const { return low.x() > high.x(); }
  [[nodiscard]] Eigen::Vector2d size() const { return high - low; }
  void include(const Eigen::Vector2d& p) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
};

/// How much of each small square of the plan is covered.
class CoverGrid {
 public:
  /// Squares of `cell_m`, or wider where that would be more than a few million.
  CoverGrid(const Bounds& bounds, double cell_m);

  void cover(const Eigen::Vector2d& p) noexcept {
    if (const auto cell = cell_of(p)) cover_cell(*cell);
  }
  void cover_cell(std::size_t cell) noexcept { values_[cell] = 1.0F; }
  /// Row by row; nothing outside the bounds.
  [[nodiscard]] std::optional<std::size_t> cell_of(const Eigen::Vector2d& p) const noexcept;
  [[nodiscard]] std::size_t cells() const noexcept { return values_.size(); }
  [[nodiscard]] int columns() const noexcept { return columns_; }
  [[nodiscard]] double cell_m() const noexcept { return cell_m_; }
  /// Closes gaps and rounds corners narrower than about `radius_m`.
  void smooth(double radius_m);
  /// The closed outlines of what is covered by half or more; holes too (fill by the even-odd rule).
  [[nodiscard]] std::vector<Polyline> outlines() const;
  [[nodiscard]] double covered_m2() const;

 private:
  [[nodiscard]] float& at(int column, int row) {
    return values_[static_cast<std::size_t>(row) * columns_ + column];
  }
  [[nodiscard]] float at(int column, int row) const {
    return values_[static_cast<std::size_t>(row) * columns_ + column];
  }
  void box_blur(int radius);

  Eigen::Vector2d origin_;  ///< centre of cell (0, 0)
  double cell_m_;
  int columns_, rows_;
  std::vector<float> values_;
};

/// Leaves out points that lie nearer than `tolerance_m` to the line (Douglas and Peucker).
[[nodiscard]] Polyline simplified(const Polyline& line, double tolerance_m);

}  // namespace maplet::draw
