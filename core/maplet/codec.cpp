// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/maplet/codec.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/base/crc.hpp"
#include "core/maplet/bit_coder.hpp"
#include "core/maplet/byte_stream.hpp"
#include "core/maplet/quantise.hpp"

namespace maplet {

namespace {

constexpr std::uint64_t kMagic = 0x544C504D;  // "MPLT"
constexpr std::uint8_t kVersion = 1;
constexpr std::size_t kCrcBytes = 4;
constexpr double kMetre = 1e4;  // lengths are written in 0.1 mm
constexpr std::int64_t kMaxLength = static_cast<std::int64_t>(codec::kMaxDistance_m * kMetre);
constexpr int kMinCell_mm = 5;
constexpr int kMaxCell_mm = 1000;

// A cell is predicted from six that came before it: its neighbours left (2) and above (4). Learnt
// over all planes of a maplet.
class CellModels {
 public:
  void start_grid() noexcept {
    for (auto& row : rows_) row.fill(0);
  }
  void start_row() noexcept {
    std::swap(rows_[2], rows_[1]);
    std::swap(rows_[1], rows_[0]);
    left_ = 0;
  }
  [[nodiscard]] BitModel& at(int column) noexcept {
    const std::uint8_t* above = &rows_[1][static_cast<std::size_t>(column) + 1];
    const unsigned context = left_ | above[0] << 2 | above[-1] << 3 | above[1] << 4 |
                             rows_[2][static_cast<std::size_t>(column) + 1] << 5;
    return models_[context];
  }
  void set(int column, bool bit) noexcept {
    rows_[0][static_cast<std::size_t>(column) + 1] = bit ? 1 : 0;
    left_ = ((left_ << 1) | (bit ? 1U : 0U)) & 3U;
  }

 private:
  std::array<BitModel, 64> models_{};
  std::array<std::array<std::uint8_t, kMaxGridCells + 2>, 3> rows_{};  // this, above, above that
  unsigned left_ = 0;
};

// Calls f(column, row, model) -> the cell, for all cells in coding order.
template <class F>
void for_cells(const CellGrid& grid, CellModels& models, F f) noexcept {
  models.start_grid();
  for (int row = 0; row < grid.rows; ++row) {
    models.start_row();
    for (int column = 0; column < grid.columns; ++column) {
      models.set(column, f(column, row, models.at(column)));
    }
  }
}

bool writable(const Maplet& m) noexcept {
  if (m.keyframes.empty()) return false;
  for (const MapletKeyframe& k : m.keyframes) {
    const Se3& T = k.T_maplet_camera.se3;
    if (!(T.t.cwiseAbs().maxCoeff() <= codec::kMaxDistance_m)) return false;
    if (!(std::abs(T.q.norm() - 1.0) < 1e-6)) return false;
  }
  for (const MapletPlane& p : m.planes) {
    if (!(std::abs(p.plane.d) <= codec::kMaxDistance_m)) return false;
    if (!(p.centre.cwiseAbs().maxCoeff() <= codec::kMaxDistance_m)) return false;
    if (!(std::abs(p.plane.n.norm() - 1.0) < 1e-6) || !p.covariance.allFinite()) return false;
  }
  return true;
}

void put_keyframes(const Maplet& m, ByteWriter& out) noexcept {
  std::int64_t before = m.stamp.count();
  for (std::size_t i = 1; i < m.keyframes.size(); ++i) {
    const MapletKeyframe& k = m.keyframes[i];
    out.put_varint(k.stamp.count() - before);
    before = k.stamp.count();
    for (const double x : k.T_maplet_camera.se3.t) out.put_varint(std::llround(x * kMetre));
    out.put(codec::pack_rotation(k.T_maplet_camera.se3.q), 7);
  }
}

bool get_keyframes(ByteReader& in, std::size_t count, Maplet& m) noexcept {
  if (count == 0 || count > kMaxMapletKeyframes) return false;
  m.keyframes.push_back({m.stamp, {}});
  std::int64_t stamp = m.stamp.count();
  for (std::size_t i = 1; i < count; ++i) {
    MapletKeyframe k;
    const std::int64_t step = in.get_varint();
    if (__builtin_add_overflow(stamp, step, &stamp)) return false;
    k.stamp = Stamp{stamp};
    for (double& x : k.T_maplet_camera.se3.t) {
      const std::int64_t length = in.get_varint();
      if (length < -kMaxLength || length > kMaxLength) return false;
      x = static_cast<double>(length) / kMetre;
    }
    if (!codec::unpack_rotation(in.get(7), k.T_maplet_camera.se3.q)) return false;
    m.keyframes.push_back(k);
  }
  return !in.ran_short();
}

void put_plane(const MapletPlane& p, ByteWriter& out) noexcept {
  const std::uint32_t normal = codec::pack_normal(p.plane.n);
  out.put(normal, 4);
  // The offset that keeps the plane's centre where it is, whatever rounding did to the normal.
  const double d =
      -codec::unpack_normal(normal).dot(p.centre - p.plane.distance(p.centre) * p.plane.n);
  out.put(static_cast<std::uint64_t>(std::llround(d * kMetre)), 3);
  const codec::PackedCovariance c = codec::pack_covariance(p.covariance);
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

bool get_grid(ByteReader& in, Maplet& m, MapletPlane& p) noexcept {
  const std::uint64_t packed = in.get(1);
  p.grid.level = static_cast<std::uint8_t>(packed & 0xFU);
  p.grid.axis = static_cast<std::uint8_t>(packed >> 4);
  if (p.grid.level > CellGrid::kMaxLevel || p.grid.axis > 2) return false;
  if (std::abs(p.plane.n[p.grid.axis]) > 0.9) return false;
  std::int64_t values[4];
  for (std::int64_t& value : values) value = in.get_varint();
  constexpr std::int64_t kMaxIndex = 32000;
  if (std::abs(values[0]) > kMaxIndex || std::abs(values[1]) > kMaxIndex) return false;
  if (values[2] < 0 || values[2] > kMaxGridCells) return false;
  if (values[3] < 0 || values[3] > kMaxGridCells) return false;
  p.grid.column0 = static_cast<std::int16_t>(values[0]);
  p.grid.row0 = static_cast<std::int16_t>(values[1]);
  p.grid.columns = static_cast<std::uint16_t>(values[2]);
  p.grid.rows = static_cast<std::uint16_t>(values[3]);
  return m.take_cells(p.grid);
}

bool get_planes(ByteReader& in, std::size_t count, Maplet& m) noexcept {
  if (count > kMaxMapletPlanes) return false;
  for (std::size_t i = 0; i < count; ++i) {
    MapletPlane p;
    p.id = static_cast<std::uint8_t>(i);
    p.plane.n = codec::unpack_normal(static_cast<std::uint32_t>(in.get(4)));
    p.plane.d = static_cast<double>(in.get_signed(3)) / kMetre;
    codec::PackedCovariance c;
    for (std::uint8_t& s : c.log_sigma) s = in.pop();
    for (std::int8_t& r : c.correlation) r = static_cast<std::int8_t>(in.pop());
    if (!codec::unpack_covariance(c, p.covariance)) return false;
    const std::uint8_t gray = in.pop();
    p.mean_gray = gray == 0 ? -1.0F : gray;
    p.observations = in.pop();
    if (!get_grid(in, m, p) || in.ran_short()) return false;
    m.planes.push_back(p);
  }
  return true;
}

void put_cells(const Maplet& m, ByteWriter& out) noexcept {
  CellModels models;
  BitEncoder bits{out};
  for (const MapletPlane& p : m.planes) {
    for_cells(p.grid, models, [&](int column, int row, BitModel& model) {
      const bool bit = m.cell(p.grid, column, row);
      bits.put(bit, model);
      return bit;
    });
  }
  bits.finish();
}

void get_cells(ByteReader& in, Maplet& m) noexcept {
  CellModels models;
  BitDecoder bits{in};
  for (MapletPlane& p : m.planes) {
    for_cells(p.grid, models, [&](int column, int row, BitModel& model) {
      const bool bit = bits.get(model);
      if (bit) m.set_cell(p.grid, column, row);
      return bit;
    });
    m.measure_extent(p);
  }
}

}  // namespace

Expected<std::size_t> encode(const Maplet& m, std::span<std::byte> out) noexcept {
  if (!writable(m)) return fail(ErrorCode::kBadInput, "maplet has no keyframe or odd values");
  ByteWriter body{out.subspan(std::min(out.size(), codec::kHeaderBytes))};
  put_keyframes(m, body);
  for (const MapletPlane& p : m.planes) put_plane(p, body);
  put_cells(m, body);
  const std::size_t size = codec::kHeaderBytes + body.size() + kCrcBytes;
  if (size > out.size()) return fail(ErrorCode::kCapacity, "maplet does not fit");

  ByteWriter header{out};
  header.put(kMagic, 4);
  header.put(kVersion, 1);
  header.put(m.keyframes.size(), 1);
  header.put(m.planes.size(), 1);
  header.put(0, 1);
  header.put(static_cast<std::uint64_t>(std::lround(m.cell_m * 1e3)), 2);
  header.put(m.key.agent, 2);
  header.put(m.key.epoch, 4);
  header.put(m.key.id, 4);
  header.put(static_cast<std::uint64_t>(m.stamp.count()), 8);
  header.put(size, 4);
  ByteWriter tail{out.subspan(size - kCrcBytes)};
  tail.put(crc32c(out.first(size - kCrcBytes)), kCrcBytes);
  return size;
}

Expected<void> decode(std::span<const std::byte> bytes, Maplet& m) noexcept {
  m.clear();
  if (bytes.size() < codec::kHeaderBytes + kCrcBytes) {
    return fail(ErrorCode::kBadInput, "too short for a maplet");
  }
  ByteReader in{bytes.first(bytes.size() - kCrcBytes)};
  if (in.get(4) != kMagic) return fail(ErrorCode::kBadInput, "not a maplet");
  if (in.get(1) != kVersion) return fail(ErrorCode::kBadInput, "maplet of an unknown version");
  if (ByteReader{bytes.last(kCrcBytes)}.get(kCrcBytes) !=
      crc32c(bytes.first(bytes.size() - kCrcBytes))) {
    return fail(ErrorCode::kBadInput, "maplet is damaged: its checksum differs");
  }
  const std::size_t keyframes = in.get(1);
  const std::size_t planes = in.get(1);
  const bool reserved_is_zero = in.get(1) == 0;
  const auto cell_mm = static_cast<int>(in.get(2));
  m.cell_m = cell_mm * 1e-3;
  m.key.agent = static_cast<std::uint16_t>(in.get(2));
  m.key.epoch = static_cast<std::uint32_t>(in.get(4));
  m.key.id = static_cast<std::uint32_t>(in.get(4));
  m.stamp = Stamp{static_cast<std::int64_t>(in.get(8))};
  if (in.get(4) != bytes.size()) return fail(ErrorCode::kBadInput, "maplet is cut short");
  if (!reserved_is_zero || cell_mm < kMinCell_mm || cell_mm > kMaxCell_mm ||
      !get_keyframes(in, keyframes, m) || !get_planes(in, planes, m)) {
    return fail(ErrorCode::kBadInput, "maplet holds values out of range");
  }
  get_cells(in, m);
  return {};
}

}  // namespace maplet
