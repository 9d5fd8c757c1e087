// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/maplet/codec_fields.hpp"

#include <algorithm>
#include <cmath>

#include "core/geometry/direction_code.hpp"
#include "core/maplet/codec.hpp"
#include "core/maplet/quantise.hpp"

namespace maplet::codec {

namespace {

constexpr std::int64_t kMaxLength = static_cast<std::int64_t>(kMaxDistance_m * kMetre);

bool sound(const CellGrid& grid) noexcept {
  return grid.level <= CellGrid::kMaxLevel && grid.axis <= 2 &&
         std::abs(grid.column0) <= kMaxGridIndex && std::abs(grid.row0) <= kMaxGridIndex &&
         grid.columns <= kMaxGridCells && grid.rows <= kMaxGridCells;
}

bool get_grid(ByteReader& in, Maplet& m, MapletPlane& p) noexcept {
  const std::uint64_t packed = in.get(1);
  p.grid.level = static_cast<std::uint8_t>(packed & 0xFU);
  p.grid.axis = static_cast<std::uint8_t>(packed >> 4);
  if (p.grid.level > CellGrid::kMaxLevel || p.grid.axis > 2) return false;
  if (std::abs(p.plane.n[p.grid.axis]) > kMaxLean) return false;
  std::int64_t values[4];
  for (std::int64_t& value : values) value = in.get_varint();
  if (std::abs(values[0]) > kMaxGridIndex || std::abs(values[1]) > kMaxGridIndex) return false;
  if (values[2] < 0 || values[2] > kMaxGridCells) return false;
  if (values[3] < 0 || values[3] > kMaxGridCells) return false;
  p.grid.column0 = static_cast<std::int16_t>(values[0]);
  p.grid.row0 = static_cast<std::int16_t>(values[1]);
  p.grid.columns = static_cast<std::uint16_t>(values[2]);
  p.grid.rows = static_cast<std::uint16_t>(values[3]);
  return m.take_cells(p.grid);
}

}  // namespace

bool writable(const Maplet& m) noexcept {
  if (m.keyframes.empty()) return false;
  const double cell_mm = 1e3 * m.cell_m;
  if (!(cell_mm >= kMinCell_mm && cell_mm <= kMaxCell_mm)) return false;
  if (!m.up.isZero() && !(std::abs(m.up.norm() - 1.0) < 1e-6)) return false;
  for (const MapletKeyframe& k : m.keyframes) {
    const Se3& T = k.T_maplet_camera.se3;
    if (!(T.t.cwiseAbs().maxCoeff() <= kMaxDistance_m)) return false;
    if (!(std::abs(T.q.norm() - 1.0) < 1e-6)) return false;
  }
  for (const MapletPlane& p : m.planes) {
    if (!(std::abs(p.plane.d) <= kMaxDistance_m)) return false;
    if (!(p.centre.cwiseAbs().maxCoeff() <= kMaxDistance_m)) return false;
    if (!(std::abs(p.plane.n.norm() - 1.0) < 1e-6) || !p.covariance.allFinite()) return false;
    if (!(p.covariance.diagonal().minCoeff() >= 0.0)) return false;
    constexpr double kRounding = 1e-4;
    if (!sound(p.grid) || std::abs(p.plane.n[p.grid.axis]) > kMaxLean - kRounding) {
      return false;
    }
  }
  return true;
}

void put_keyframes(const Maplet& m, std::size_t first, std::size_t count,
                   ByteWriter& out) noexcept {
  std::int64_t before = (first <= 1 ? m.stamp : m.keyframes[first - 1].stamp).count();
  for (std::size_t i = std::max<std::size_t>(first, 1); i < first + count; ++i) {
    const MapletKeyframe& k = m.keyframes[i];
    out.put_varint(k.stamp.count() - before);
    before = k.stamp.count();
    for (const double x : k.T_maplet_camera.se3.t) out.put_varint(std::llround(x * kMetre));
    out.put(pack_rotation(k.T_maplet_camera.se3.q), 7);
  }
}

bool get_keyframes(ByteReader& in, std::size_t count, Maplet& m) noexcept {
  const std::size_t end = m.keyframes.size() + count;
  if (end == 0 || end > kMaxMapletKeyframes) return false;
  if (m.keyframes.empty()) m.keyframes.push_back({m.stamp, {}});
  std::int64_t stamp = m.keyframes.back().stamp.count();
  while (m.keyframes.size() < end) {
    MapletKeyframe k;
    const std::int64_t step = in.get_varint();
    if (__builtin_add_overflow(stamp, step, &stamp)) return false;
    k.stamp = Stamp{stamp};
    for (double& x : k.T_maplet_camera.se3.t) {
      const std::int64_t length = in.get_varint();
      if (length < -kMaxLength || length > kMaxLength) return false;
      x = static_cast<double>(length) / kMetre;
    }
    if (!unpack_rotation(in.get(7), k.T_maplet_camera.se3.q)) return false;
    m.keyframes.push_back(k);
  }
  return !in.ran_short();
}

void put_plane(const MapletPlane& p, ByteWriter& out) noexcept {
  const std::uint32_t normal = pack_direction(p.plane.n);
  out.put(normal, 4);
  // The offset that keeps the plane's centre where it is, whatever rounding did to the normal.
  const double d = -unpack_direction(normal).dot(p.centre - p.plane.distance(p.centre) * p.plane.n);
  out.put(static_cast<std::uint64_t>(std::llround(d * kMetre)), 3);
  const PackedCovariance c = pack_covariance(p.covariance);
  for (const std::uint8_t s : c.log_sigma) out.put(s, 1);
  for (const std::int8_t r : c.correlation) out.put(static_cast<std::uint8_t>(r), 1);
  const double gray = p.mean_gray < 0.0F ? 0.0 : std::clamp(p.mean_gray, 1.0F, 255.0F);
  out.put(static_cast<std::uint64_t>(std::lround(gray)), 1);
  out.put(p.observations, 1);
  out.put(p.grid.level | (p.grid.axis << 4), 1);
  out.put_varint(p.grid.column0);
  out.put_varint(p.grid.row0);
  out.put_varint(p.grid.columns);
  out.put_varint(p.grid.rows);
}

bool get_planes(ByteReader& in, std::size_t count, Maplet& m) noexcept {
  if (count > kMaxMapletPlanes - m.planes.size()) return false;
  for (std::size_t i = 0; i < count; ++i) {
    MapletPlane p;
    p.id = static_cast<std::uint8_t>(m.planes.size());
    p.plane.n = unpack_direction(static_cast<std::uint32_t>(in.get(4)));
    p.plane.d = static_cast<double>(in.get_signed(3)) / kMetre;
    PackedCovariance c;
    for (std::uint8_t& s : c.log_sigma) s = in.pop();
    for (std::int8_t& r : c.correlation) r = static_cast<std::int8_t>(in.pop());
    if (!unpack_covariance(c, p.covariance)) return false;
    const std::uint8_t gray = in.pop();
    p.mean_gray = gray == 0 ? -1.0F : gray;
    p.observations = in.pop();
    if (!get_grid(in, m, p) || in.ran_short()) return false;
    m.planes.push_back(p);
  }
  return true;
}

}  // namespace maplet::codec
