// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tests/support/synthetic_run.hpp"

#include <fmt/core.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <memory>
#include <numbers>
#include <optional>
#include <stdexcept>

#include "core/maplet/codec.hpp"
#include "core/maplet/maplet.hpp"

namespace maplet::test {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kFloor_m = 1.2;  // below the camera; y points down
constexpr double kHigh_m = 2.4;
constexpr double kRange_m = 4.5;
constexpr double kCell_m = 0.06;

/// A wall over the floor line (x0, z0) to (x1, z1).
Panel wall(double x0, double z0, double x1, double z1, double high_m = kHigh_m) {
  return {Vector3d{x0, kFloor_m, z0}, Vector3d{x1 - x0, 0, z1 - z0}, Vector3d{0, -high_m, 0}};
}

Panel level(double x0, double z0, double x1, double z1, double above_m) {
  return {Vector3d{x0, kFloor_m - above_m, z0}, Vector3d{x1 - x0, 0, 0}, Vector3d{0, 0, z1 - z0}};
}

void add_box(std::vector<Panel>& panels, double x0, double z0, double x1, double z1, double high) {
  panels.push_back(wall(x0, z0, x1, z0, high));
  panels.push_back(wall(x1, z0, x1, z1, high));
  panels.push_back(wall(x1, z1, x0, z1, high));
  panels.push_back(wall(x0, z1, x0, z0, high));
  panels.push_back(level(x0, z0, x1, z1, high));
}

Se3 tilt(double rad) {
  return {Eigen::Quaterniond{Eigen::AngleAxisd{-rad, Vector3d::UnitX()}}, Vector3d::Zero()};
}

/// Where the ray from `eye` to `p` meets the panel before p, if it does.
bool blocks(const Panel& panel, const Vector3d& eye, const Vector3d& p) {
  const Vector3d n = panel.a.cross(panel.b);
  const Vector3d ray = p - eye;
  const double along = n.dot(ray);
  if (std::abs(along) < 1e-9) return false;
  const double s = n.dot(panel.corner - eye) / along;
  if (s <= 1e-6 || s >= 0.995) return false;
  const Vector3d off = eye + s * ray - panel.corner;
  const double u = off.dot(panel.a) / panel.a.squaredNorm();
  const double v = off.dot(panel.b) / panel.b.squaredNorm();
  return u >= 0.0 && u <= 1.0 && v >= 0.0 && v <= 1.0;
}

bool sees(const std::vector<Panel>& panels, const Se3& T_world_camera, const Vector3d& p) {
  const Vector3d at = T_world_camera.inverse() * p;
  if (at.z() < 0.4 || at.z() > kRange_m) return false;
  if (std::abs(at.x()) > 0.55 * at.z() || std::abs(at.y()) > 0.42 * at.z()) return false;
  return std::ranges::none_of(
      panels, [&](const Panel& panel) { return blocks(panel, T_world_camera.t, p); });
}

/// What the cameras see of a panel, added to the maplet whose origin is cameras[0].
void add_plane(Maplet& out, const std::vector<Panel>& panels, const Panel& panel,
               const std::vector<Se3>& cameras) {
  Vector3d n = panel.a.cross(panel.b).normalized();
  if (n.dot(cameras[0].t - panel.corner) < 0.0) n = -n;
  const Se3 T_maplet_world = cameras[0].inverse();
  MapletPlane plane;
  plane.id = static_cast<std::uint8_t>(out.planes.size());
  plane.observations = static_cast<std::uint8_t>(cameras.size());
  plane.plane = T_maplet_world * Plane{n, -n.dot(panel.corner)};
  plane.grid.axis = PlaneBasis::best_axis(plane.plane.n);
  plane.covariance = Eigen::Matrix3d::Identity() * 1e-6;
  const PlaneBasis basis = plane.basis();

  const int steps_a = static_cast<int>(panel.a.norm() / (0.7 * kCell_m)) + 1;
  const int steps_b = static_cast<int>(panel.b.norm() / (0.7 * kCell_m)) + 1;
  std::vector<Eigen::Vector2i> cells;
  for (int i = 0; i < steps_a; ++i) {
    for (int j = 0; j < steps_b; ++j) {
      const Vector3d p =
          panel.corner + (i + 0.5) / steps_a * panel.a + (j + 0.5) / steps_b * panel.b;
      if (std::ranges::none_of(cameras, [&](const Se3& T) { return sees(panels, T, p); })) continue;
      const Vector2d at = basis.coordinates(T_maplet_world * p) / kCell_m;
      cells.emplace_back(std::floor(at.x()), std::floor(at.y()));
    }
  }
  if (cells.size() < 12 || full(out.planes)) return;
  Eigen::Vector2i low = cells[0];
  Eigen::Vector2i high = cells[0];
  for (const auto& cell : cells) {
    low = low.cwiseMin(cell);
    high = high.cwiseMax(cell);
  }
  plane.grid.column0 = static_cast<std::int16_t>(low.x());
  plane.grid.row0 = static_cast<std::int16_t>(low.y());
  plane.grid.columns = static_cast<std::uint16_t>(high.x() - low.x() + 1);
  plane.grid.rows = static_cast<std::uint16_t>(high.y() - low.y() + 1);
  if (!out.take_cells(plane.grid)) throw std::runtime_error{"synthetic maplet is too large"};
  for (const auto& cell : cells) out.set_cell(plane.grid, cell.x() - low.x(), cell.y() - low.y());
  out.measure_extent(plane);
  out.planes.push_back(plane);
}

void write_maplet(const std::filesystem::path& file, const Maplet& maplet) {
  std::array<std::byte, kMaxMapletBytes> bytes{};
  const auto size = encode(maplet, bytes);
  if (!size) throw std::runtime_error{size.error().what};
  std::ofstream{file, std::ios::binary}.write(reinterpret_cast<const char*>(bytes.data()),
                                              static_cast<std::streamsize>(*size));
}

void write_tum(const std::filesystem::path& file, const std::vector<Se3>& poses) {
  std::ofstream out{file};
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const auto& [q, t] = poses[i];
    out << fmt::format("{:.6f} {:.6f} {:.6f} {:.6f} {:.6f} {:.6f} {:.6f} {:.6f}\n",
                       static_cast<double>(i) / 30.0, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(),
                       q.w());
  }
}

/// Each step a little too far to the left and turned too much.
std::vector<Se3> drifting(const std::vector<Se3>& truth) {
  std::vector<Se3> out{truth.front()};
  Vector6d slip;
  slip << -0.0004, 0, 0.0006, 0, 0.00025, 0;
  for (std::size_t i = 1; i < truth.size(); ++i) {
    out.push_back(out.back() * (truth[i - 1].inverse() * truth[i]) * Se3::exp(slip));
  }
  return out;
}

void write_skeleton(const std::filesystem::path& file, const std::vector<Se3>& origins) {
  std::ofstream out{file};
  const auto write = [&out](const Se3& T) {
    out << fmt::format(" {:.6f} {:.6f} {:.6f} {:.8f} {:.8f} {:.8f} {:.8f}", T.t.x(), T.t.y(),
                       T.t.z(), T.q.x(), T.q.y(), T.q.z(), T.q.w());
  };
  for (std::size_t i = 0; i < origins.size(); ++i) {
    out << "VERTEX_SE3:QUAT " << i;
    write(origins[i]);
    out << '\n';
  }
  out << "FIX 0\n";
  const auto edge = [&](std::size_t a, std::size_t b) {
    out << "EDGE_SE3:QUAT " << a << ' ' << b;
    write(origins[a].inverse() * origins[b]);
    for (int row = 0; row < 6; ++row) {
      for (int column = row; column < 6; ++column) out << (row == column ? " 10000" : " 0");
    }
    out << '\n';
  };
  for (std::size_t i = 1; i < origins.size(); ++i) edge(i - 1, i);
  if (origins.size() > 3) edge(0, origins.size() - 1);
}

}  // namespace

std::vector<Panel> flat(double tilt_rad) {
  std::vector<Panel> panels{
      // outside
      wall(-3, -1, 6, -1), wall(6, -1, 6, 5.5), wall(6, 5.5, -3, 5.5), wall(-3, 5.5, -3, -1),
      // the corridor's wall, with two doors
      wall(-3, 0.9, -1.6, 0.9), wall(-0.6, 0.9, 3.4, 0.9), wall(4.4, 0.9, 6, 0.9),
      // between the two rooms, with a door
      wall(1.6, 0.9, 1.6, 3.6), wall(1.6, 4.6, 1.6, 5.5),
      // floor and ceiling
      level(-3, -1, 6, 5.5, 0.0), level(-3, -1, 6, 5.5, kHigh_m)};
  add_box(panels, -2.2, 2.4, -0.8, 3.4, 0.75);  // a table
  add_box(panels, 0.2, 5.0, 1.4, 5.5, 1.9);     // a shelf
  add_box(panels, 4.8, 2.6, 6.0, 4.6, 0.5);     // a bed
  add_box(panels, 1.6, 1.0, 2.6, 1.45, 2.0);    // a wardrobe
  add_box(panels, 5.55, -1.0, 6.0, -0.1, 0.9);  // a chest of drawers
  const Se3 T = tilt(-tilt_rad);
  for (Panel& panel : panels) panel = {T * panel.corner, T.q * panel.a, T.q * panel.b};
  return panels;
}

std::vector<Se3> walk_through_flat(int count, double tilt_rad) {
  // Over the floor: corridor, right room, door, left room, corridor, start. The camera starts at 0.
  const std::vector<Vector2d> corners{
      {0, 0},     {1.8, -0.1}, {3.7, 0.0},  {3.95, 1.3}, {3.7, 3.2},   {2.6, 4.2},  {1.6, 4.1},
      {0.3, 4.0}, {-0.3, 2.9}, {-0.9, 1.6}, {-1.1, 0.4}, {-0.6, -0.1}, {0.02, 0.02}};
  const auto point = [&](double s) {  // Catmull-Rom
    const double at = s * static_cast<double>(corners.size() - 1);
    const auto k = std::min(static_cast<std::size_t>(at), corners.size() - 2);
    const double f = at - static_cast<double>(k);
    const Vector2d& p1 = corners[k];
    const Vector2d& p2 = corners[k + 1];
    const Vector2d& p0 = k > 0 ? corners[k - 1] : p1;
    const Vector2d& p3 = k + 2 < corners.size() ? corners[k + 2] : p2;
    return Vector2d{0.5 * (2 * p1 + (p2 - p0) * f + (2 * p0 - 5 * p1 + 4 * p2 - p3) * f * f +
                           (3 * p1 - p0 - 3 * p2 + p3) * f * f * f)};
  };
  const Se3 T_first_level = tilt(-tilt_rad);
  std::vector<Se3> poses;
  std::optional<Se3> T_start;
  for (int i = 0; i < count; ++i) {
    const double s = static_cast<double>(i) / std::max(count - 1, 1);
    const Vector2d at = point(s);
    const Vector2d ahead = point(std::min(s + 0.02, 1.0)) - point(std::max(s - 0.02, 0.0));
    const double yaw =
        std::atan2(ahead.x(), ahead.y()) + 0.7 * std::sin(14.0 * std::numbers::pi * s);
    const Se3 T{Eigen::Quaterniond{Eigen::AngleAxisd{yaw, Vector3d::UnitY()}},
                Vector3d{at.x(), 0.0, at.y()}};
    poses.push_back(T_first_level * T * tilt(tilt_rad));
  }
  return poses;
}

void write_synthetic_run(const std::filesystem::path& folder, const RunOptions& options) {
  std::filesystem::create_directories(folder / "maplets");
  const std::vector<Panel> panels = flat(options.tilt_rad);
  const std::vector<Se3> truth = walk_through_flat(options.frames, options.tilt_rad);
  write_tum(folder / "trajectory.tum", truth);
  write_tum(folder / "odometry.tum", drifting(truth));

  std::vector<Se3> origins;
  double bytes = 0.0;
  const auto maplet = std::make_unique<Maplet>();
  for (int k = 0; k < options.maplets; ++k) {
    const int first = k * (options.frames - 1) / options.maplets;
    const int span = options.frames / options.maplets;
    std::vector<Se3> cameras;
    for (int i = 0; i < 4; ++i)
      cameras.push_back(truth[static_cast<std::size_t>(first + i * span / 3)]);
    maplet->clear();
    maplet->key.id = static_cast<std::uint32_t>(k);
    maplet->cell_m = kCell_m;
    maplet->stamp = std::chrono::milliseconds{first * 1000 / 30};
    for (const Se3& camera : cameras) {
      maplet->keyframes.push_back(
          {maplet->stamp, Transform<MapletFrame, CameraFrame>{cameras[0].inverse() * camera}});
    }
    for (const Panel& panel : panels) add_plane(*maplet, panels, panel, cameras);
    const auto file = folder / "maplets" / fmt::format("{:04}.maplet", k);
    write_maplet(file, *maplet);
    bytes += static_cast<double>(std::filesystem::file_size(file));
    origins.push_back(cameras[0]);
  }
  write_skeleton(folder / "skeleton.g2o", origins);
  std::ofstream{folder / "report.json"} << fmt::format(
      R"({{"frames":{{"read":{0},"processed":{0},"dropped":0}},"maplets":{{"count":{1},"bytes_mean":{2},"point_cloud_bytes_mean":3100000}}}})"
      "\n",
      options.frames, options.maplets, bytes / options.maplets);
}

}  // namespace maplet::test
