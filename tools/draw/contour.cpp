// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/draw/contour.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <utility>

namespace maplet::draw {
namespace {

using Eigen::Vector2d;

constexpr double kMaxCells = 4e6;
constexpr int kBorder = 8;  // empty cells around, so that outlines close
constexpr float kLevel = 0.5F;

/// The running mean over 2 radius + 1 values, `stride` apart.
void blur_line(float* first, int count, std::ptrdiff_t stride, int radius,
               std::vector<float>& copy) {
  copy.resize(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) copy[static_cast<std::size_t>(i)] = first[i * stride];
  const auto value = [&](int i) {
    return i >= 0 && i < count ? copy[static_cast<std::size_t>(i)] : 0.0F;
  };
  float sum = 0.0F;
  for (int i = -radius; i < radius; ++i) sum += value(i);
  const float scale = 1.0F / static_cast<float>(2 * radius + 1);
  for (int i = 0; i < count; ++i) {
    sum += value(i + radius);
    first[i * stride] = std::max(sum * scale, 0.0F);
    sum -= value(i - radius);
  }
}

void simplify(const Polyline& line, std::size_t first, std::size_t last, double tolerance_m,
              std::vector<bool>& keep) {
  const Vector2d along = line[last] - line[first];
  const double length = along.norm();
  double farthest_m = tolerance_m;
  std::size_t at = 0;
  for (std::size_t i = first + 1; i < last; ++i) {
    const Vector2d off = line[i] - line[first];
    const double away_m =
        length > 1e-12 ? std::abs(along.x() * off.y() - along.y() * off.x()) / length : off.norm();
    if (away_m > farthest_m) {
      farthest_m = away_m;
      at = i;
    }
  }
  if (at == 0) return;
  keep[at] = true;
  simplify(line, first, at, tolerance_m, keep);
  simplify(line, at, last, tolerance_m, keep);
}

}  // namespace

CoverGrid::CoverGrid(const Bounds& bounds, double cell_m) {
  const Vector2d size = bounds.size().cwiseMax(1e-3);
  cell_m_ = std::max(cell_m, std::sqrt(size.x() * size.y() / kMaxCells));
  origin_ = bounds.low - Vector2d::Constant(kBorder * cell_m_);
  columns_ = static_cast<int>(size.x() / cell_m_) + 2 * kBorder + 2;
  rows_ = static_cast<int>(size.y() / cell_m_) + 2 * kBorder + 2;
  values_.assign(static_cast<std::size_t>(columns_) * rows_, 0.0F);
}

std::optional<std::size_t> CoverGrid::cell_of(const Vector2d& p) const noexcept {
  const Vector2d cell = (p - origin_) / cell_m_;
  const double column = std::round(cell.x());
  const double row = std::round(cell.y());
  const bool inside =
      column >= kBorder && row >= kBorder && column < columns_ - kBorder && row < rows_ - kBorder;
  if (!inside) return {};
  return static_cast<std::size_t>(row) * columns_ + static_cast<std::size_t>(column);
}

void CoverGrid::box_blur(int radius) {
  std::vector<float> copy;
  for (int row = 0; row < rows_; ++row) blur_line(&at(0, row), columns_, 1, radius, copy);
  for (int column = 0; column < columns_; ++column) {
    blur_line(&at(column, 0), rows_, columns_, radius, copy);
  }
}

void CoverGrid::smooth(double radius_m) {
  const int radius = std::max(1, static_cast<int>(std::lround(radius_m / cell_m_)));
  box_blur(radius);
  box_blur(radius);  // twice a box is nearly round
}

double CoverGrid::covered_m2() const {
  return static_cast<double>(std::ranges::count_if(values_, [](float v) { return v >= kLevel; })) *
         cell_m_ * cell_m_;
}

std::vector<Polyline> CoverGrid::outlines() const {
  // Marching squares: every edge of the grid that the outline crosses has a number; `next` leads
  // from one crossing to the following, covered side on the right.
  using Edge = std::int64_t;
  const auto horizontal = [&](int c, int r) { return 2 * (Edge{r} * columns_ + c); };
  const auto vertical = [&](int c, int r) { return 2 * (Edge{r} * columns_ + c) + 1; };
  const auto crossing = [&](Edge edge) {
    const Edge cell = edge / 2;
    const int c = static_cast<int>(cell % columns_);
    const int r = static_cast<int>(cell / columns_);
    const int dc = edge % 2 == 0 ? 1 : 0;
    const int dr = 1 - dc;
    const float a = at(c, r);
    const float b = at(c + dc, r + dr);
    const double f = (kLevel - a) / (b - a);
    return Vector2d{origin_ + cell_m_ * Vector2d{c + f * dc, r + f * dr}};
  };
  std::map<Edge, Edge> next;
  for (int r = 0; r + 1 < rows_; ++r) {
    for (int c = 0; c + 1 < columns_; ++c) {
      const bool in[] = {at(c, r) >= kLevel, at(c + 1, r) >= kLevel, at(c + 1, r + 1) >= kLevel,
                         at(c, r + 1) >= kLevel};
      const Edge side[] = {horizontal(c, r), vertical(c + 1, r), horizontal(c, r + 1),
                           vertical(c, r)};
      // Side i lies between corner i and the next one, anticlockwise. The outline enters where
      // corners go from covered to bare and leaves at the next side where they go back.
      for (int i = 0; i < 4; ++i) {
        if (!in[i] || in[(i + 1) % 4]) continue;
        int j = (i + 3) % 4;
        while (in[j]) j = (j + 3) % 4;
        next[side[j]] = side[i];
      }
    }
  }
  std::vector<Polyline> out;
  while (!next.empty()) {
    Polyline line;
    for (auto at_edge = next.begin(); at_edge != next.end();) {
      line.push_back(crossing(at_edge->first));
      const Edge to = at_edge->second;
      next.erase(at_edge);
      at_edge = next.find(to);
    }
    if (line.size() > 3) out.push_back(std::move(line));
  }
  return out;
}

Polyline simplified(const Polyline& line, double tolerance_m) {
  if (line.size() < 3) return line;
  std::vector<bool> keep(line.size(), false);
  keep.front() = keep.back() = true;
  simplify(line, 0, line.size() - 1, tolerance_m, keep);
  Polyline out;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (keep[i]) out.push_back(line[i]);
  }
  return out;
}

}  // namespace maplet::draw
