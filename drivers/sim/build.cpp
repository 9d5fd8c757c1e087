// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/sim/build.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>

namespace maplet::sim {
namespace {

constexpr double kSamePlane = 1e-9;

void unique_sorted(std::vector<double>& values) {
  std::sort(values.begin(), values.end());
  values.erase(
      std::unique(values.begin(), values.end(), [](double a, double b) { return b - a < 1e-6; }),
      values.end());
}

/// The plan's cells between all the rectangles' edges; outside is solid.
class Cells {
 public:
  explicit Cells(const std::vector<Rect>& free) : free_{&free} {
    for (const Rect& r : free) {
      xs.insert(xs.end(), {r.x0, r.x1});
      ys.insert(ys.end(), {r.y0, r.y1});
    }
    unique_sorted(xs);
    unique_sorted(ys);
  }
  [[nodiscard]] bool is_free(int i, int j) const {
    if (i < 0 || j < 0 || i + 1 >= columns() || j + 1 >= rows()) return false;
    const double x = 0.5 * (xs[static_cast<std::size_t>(i)] + xs[static_cast<std::size_t>(i) + 1]);
    const double y = 0.5 * (ys[static_cast<std::size_t>(j)] + ys[static_cast<std::size_t>(j) + 1]);
    return std::any_of(free_->begin(), free_->end(),
                       [&](const Rect& r) { return x > r.x0 && x < r.x1 && y > r.y0 && y < r.y1; });
  }
  [[nodiscard]] int columns() const { return static_cast<int>(xs.size()); }
  [[nodiscard]] int rows() const { return static_cast<int>(ys.size()); }

  std::vector<double> xs;
  std::vector<double> ys;

 private:
  const std::vector<Rect>* free_;
};

/// Runs of `wanted(k)` in [0, count): begin and end.
template <class Wanted, class Use>
void for_runs(int count, Wanted wanted, Use use) {
  for (int k = 0; k < count; ++k) {
    if (!wanted(k)) continue;
    const int begin = k;
    while (k < count && wanted(k)) ++k;
    use(static_cast<std::size_t>(begin), static_cast<std::size_t>(k));
  }
}

}  // namespace

std::uint16_t Builder::plane_of(const Plane& plane) {
  auto& planes = world_->planes;
  for (std::size_t i = 0; i < planes.size(); ++i) {
    if ((planes[i].n - plane.n).norm() < kSamePlane && std::abs(planes[i].d - plane.d) < kSamePlane)
      return static_cast<std::uint16_t>(i + 1);
  }
  planes.push_back(plane);
  return static_cast<std::uint16_t>(planes.size());
}

void Builder::rectangle(const Eigen::Vector3d& corner, const Eigen::Vector3d& along,
                        const Eigen::Vector3d& across, Look look, bool decal) {
  const Eigen::Vector3d n = along.cross(across).normalized();
  world_->surfaces.push_back(
      {corner, along, across, plane_of({n, -n.dot(corner)}), look.material, look.albedo, decal});
}

void Builder::box(const Spot& spot, const Eigen::Vector3d& centre, const Eigen::Vector3d& size,
                  Look look, double pitch_rad) {
  using Eigen::Vector3d;
  const Eigen::Matrix3d yaw = Eigen::AngleAxisd{spot.yaw_rad, Vector3d::UnitZ()}.toRotationMatrix();
  const Eigen::Matrix3d R =
      pitch_rad == 0.0
          ? yaw
          : Eigen::Matrix3d{yaw *
                            Eigen::AngleAxisd{pitch_rad, Vector3d::UnitX()}.toRotationMatrix()};
  const Vector3d bottom = Vector3d{spot.x_m, spot.y_m, spot.z_m} + yaw * centre;
  const Vector3d x = R.col(0) * size.x();
  const Vector3d y = R.col(1) * size.y();
  const Vector3d z = R.col(2) * size.z();
  const Vector3d low = bottom - 0.5 * x - 0.5 * y;
  rectangle(low, y, x, look);      // bottom
  rectangle(low + z, x, y, look);  // top
  rectangle(low, x, z, look);      // front, towards -y
  rectangle(low + y, z, x, look);  // back
  rectangle(low, z, y, look);      // left
  rectangle(low + x, y, z, look);  // right
}

void Builder::rooms(const std::vector<Rect>& free, double height_m, Look walls, Look floor,
                    Look ceiling) {
  using Eigen::Vector3d;
  const Cells cells{free};
  const auto& xs = cells.xs;
  const auto& ys = cells.ys;
  const Vector3d up{0, 0, height_m};
  const std::size_t first = world_->surfaces.size();
  for (int i = 0; i < cells.columns(); ++i) {
    const double x = xs[static_cast<std::size_t>(i)];
    const auto at = [&](std::size_t j) { return Vector3d{x, ys[j], 0}; };
    for_runs(
        cells.rows() - 1, [&](int j) { return cells.is_free(i, j) && !cells.is_free(i - 1, j); },
        [&](std::size_t a, std::size_t b) { rectangle(at(a), at(b) - at(a), up, walls); });
    for_runs(
        cells.rows() - 1, [&](int j) { return !cells.is_free(i, j) && cells.is_free(i - 1, j); },
        [&](std::size_t a, std::size_t b) { rectangle(at(b), at(a) - at(b), up, walls); });
  }
  for (int j = 0; j < cells.rows(); ++j) {
    const double y = ys[static_cast<std::size_t>(j)];
    const auto at = [&](std::size_t i) { return Vector3d{xs[i], y, 0}; };
    for_runs(
        cells.columns() - 1, [&](int i) { return cells.is_free(i, j) && !cells.is_free(i, j - 1); },
        [&](std::size_t a, std::size_t b) { rectangle(at(b), at(a) - at(b), up, walls); });
    for_runs(
        cells.columns() - 1, [&](int i) { return !cells.is_free(i, j) && cells.is_free(i, j - 1); },
        [&](std::size_t a, std::size_t b) { rectangle(at(a), at(b) - at(a), up, walls); });
  }
  walls_.resize(world_->surfaces.size() - first);
  std::iota(walls_.begin(), walls_.end(), first);
  // One floor and one ceiling: what lies in the solid is behind walls.
  const Vector3d low{xs.front(), ys.front(), 0};
  const Vector3d x{xs.back() - xs.front(), 0, 0};
  const Vector3d y{0, ys.back() - ys.front(), 0};
  rectangle(low, x, y, floor);
  rectangle(low + up, y, x, ceiling);
}

void Builder::hang_posters(Random& random) {
  constexpr double kEvery = 1.5;  // m of wall
  for (const std::size_t index : walls_) {
    const Surface wall = world_->surfaces[index];
    // One of a wall's edges goes up; posters are laid out along the other.
    const bool upright = wall.across.z() != 0.0;
    const Eigen::Vector3d level = upright ? wall.along : wall.across;
    const double length = level.norm();
    const Eigen::Vector3d e = level / length;
    for (double s = 0.0; s + 1.0 < length; s += kEvery) {
      if (!random.chance(0.7)) continue;
      const double wide = random.uniform(0.3, 0.8);
      const double above = random.uniform(0.9, 1.5);
      const double from = s + random.uniform(0.0, 1.0 - wide);
      const Eigen::Vector3d corner = wall.corner + e * from + Eigen::Vector3d{0, 0, above};
      const Eigen::Vector3d x = e * wide;
      const Eigen::Vector3d z{0, 0, random.uniform(0.3, 0.7)};
      const Look look{Material::kPoster, static_cast<float>(random.uniform(0.35, 0.9))};
      upright ? rectangle(corner, x, z, look, true) : rectangle(corner, z, x, look, true);
    }
  }
}

}  // namespace maplet::sim
