// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/maplet/codec.hpp"

#include <algorithm>
#include <cmath>

#include "core/base/crc.hpp"
#include "core/geometry/direction_code.hpp"
#include "core/maplet/byte_stream.hpp"
#include "core/maplet/cell_coder.hpp"
#include "core/maplet/codec_fields.hpp"
#include "core/maplet/quantise.hpp"

namespace maplet {

namespace {

constexpr std::uint64_t kMagic = 0x544C504D;  // "MPLT"
constexpr std::uint8_t kVersion = 2;
constexpr std::uint8_t kHasUp = 0x80;
constexpr std::size_t kLayerHeadBytes = 5;
constexpr std::size_t kCrcBytes = 4;
constexpr std::size_t kMaxLayerBytes = 0xFFFF;
constexpr std::size_t kCodingSlack = 8;  // the range coder's end, at most
constexpr int kCoarseShift = 2;

// Which planes and keyframes a layer adds, and how its planes' cells are written.
struct Layer {
  std::size_t first_plane = 0, planes = 0;
  std::size_t first_keyframe = 0, keyframes = 0;
  int shift = 0;               // of its own planes
  std::size_t refined_to = 0;  // planes before this one get their exact cells
};

void put_records(const Maplet& m, const Layer& layer, ByteWriter& out) noexcept {
  codec::put_keyframes(m, layer.first_keyframe, layer.keyframes, out);
  for (std::size_t i = 0; i < layer.planes; ++i) {
    codec::put_plane(m.planes[layer.first_plane + i], out);
  }
}

// How many planes, from layer.first_plane on, fit into `budget` bytes of body.
std::size_t planes_that_fit(const Maplet& m, const Layer& layer, std::size_t budget) noexcept {
  ByteWriter records{{}};
  ByteWriter cells{{}};
  CellEncoder encoder{cells};
  codec::put_keyframes(m, layer.first_keyframe, layer.keyframes, records);
  for (std::size_t i = 0; i < layer.refined_to; ++i) {
    encoder.refine(m, m.planes[i].grid, kCoarseShift);
  }
  std::size_t count = 0;
  for (std::size_t i = layer.first_plane; i < m.planes.size(); ++i, ++count) {
    codec::put_plane(m.planes[i], records);
    encoder.put(m, m.planes[i].grid, layer.shift);
    if (records.size() + cells.size() + kCodingSlack > budget) break;
  }
  return count;
}

// Appends a layer at `at`. @return where it ends, past out.size() when it does not fit
std::size_t put_layer(const Maplet& m, const Layer& layer, std::size_t at,
                      std::span<std::byte> out) noexcept {
  ByteWriter body{out.subspan(std::min(out.size(), at + kLayerHeadBytes))};
  put_records(m, layer, body);
  CellEncoder cells{body};
  for (std::size_t i = 0; i < layer.refined_to; ++i) {
    cells.refine(m, m.planes[i].grid, kCoarseShift);
  }
  for (std::size_t i = 0; i < layer.planes; ++i) {
    cells.put(m, m.planes[layer.first_plane + i].grid, layer.shift);
  }
  cells.finish();
  const std::size_t size = kLayerHeadBytes + body.size() + kCrcBytes;
  if (size > kMaxLayerBytes || at + size > out.size()) return out.size() + 1;
  ByteWriter head{out.subspan(at)};
  head.put(size, 2);
  head.put(layer.planes, 1);
  head.put(layer.keyframes, 1);
  head.put(static_cast<std::uint64_t>(layer.shift), 1);
  return at + size;
}

// The layers of a maplet: one when it is small.
StaticVector<Layer, codec::kMaxLayers> plan(const Maplet& m) noexcept {
  constexpr std::size_t kFrame = kLayerHeadBytes + kCrcBytes;
  constexpr std::size_t kFirst = codec::kCoarseBytes - codec::kHeaderBytes - kFrame;
  constexpr std::size_t kSecond = codec::kMiddleBytes - codec::kCoarseBytes - kFrame;
  const std::size_t all = m.planes.size();
  StaticVector<Layer, codec::kMaxLayers> layers;
  layers.push_back({0, all, 0, m.keyframes.size(), 0, 0});
  if (all == 0 || planes_that_fit(m, layers[0], kFirst) == all) return layers;

  Layer& first = layers[0];
  first.keyframes = 1;
  first.shift = kCoarseShift;
  first.planes = std::max<std::size_t>(1, planes_that_fit(m, first, kFirst));
  Layer second{first.planes, 0, 1, m.keyframes.size() - 1, 0, first.planes};
  second.planes = planes_that_fit(m, second, kSecond);
  layers.push_back(second);
  const std::size_t told = first.planes + second.planes;
  if (told < all) layers.push_back({told, all - told, m.keyframes.size(), 0, 0, 0});
  return layers;
}

void put_header(const Maplet& m, std::size_t layers, std::size_t size,
                std::span<std::byte> out) noexcept {
  const bool has_up = !m.up.isZero();
  ByteWriter header{out};
  header.put(kMagic, 4);
  header.put(kVersion, 1);
  header.put(m.keyframes.size(), 1);
  header.put(m.planes.size(), 1);
  header.put(layers | (has_up ? kHasUp : 0U), 1);
  header.put(static_cast<std::uint64_t>(std::lround(m.cell_m * 1e3)), 2);
  header.put(m.key.agent, 2);
  header.put(m.key.epoch, 4);
  header.put(m.key.id, 4);
  header.put(static_cast<std::uint64_t>(m.stamp.count()), 8);
  header.put(size, 4);
  header.put(has_up ? pack_direction(m.up) : 0U, 4);
}

struct Header {
  std::size_t keyframes, planes, layers, size;
  MapletKey key;
  Stamp stamp;
  double cell_m;
  Eigen::Vector3d up;
};

// @return nullptr, or what is wrong
const char* get_header(ByteReader& in, Header& header) noexcept {
  if (in.get(4) != kMagic) return "not a maplet";
  if (const std::uint64_t version = in.get(1); version != kVersion) {
    return version > kVersion ? "maplet of a newer version than 2: this program is older than it"
                              : "maplet of an older version than 2: map its recording again";
  }
  header.keyframes = in.pop();
  header.planes = in.pop();
  const std::uint64_t packed = in.get(1);
  header.layers = packed & 0x7FU;
  const auto cell_mm = static_cast<int>(in.get(2));
  header.cell_m = cell_mm * 1e-3;
  header.key.agent = static_cast<std::uint16_t>(in.get(2));
  header.key.epoch = static_cast<std::uint32_t>(in.get(4));
  header.key.id = static_cast<std::uint32_t>(in.get(4));
  header.stamp = Stamp{static_cast<std::int64_t>(in.get(8))};
  header.size = static_cast<std::size_t>(in.get(4));
  const auto up = static_cast<std::uint32_t>(in.get(4));
  const bool has_up = (packed & kHasUp) != 0;
  header.up = has_up ? unpack_direction(up) : Eigen::Vector3d::Zero();
  const bool in_range = header.layers > 0 && header.layers <= codec::kMaxLayers &&
                        cell_mm >= codec::kMinCell_mm && cell_mm <= codec::kMaxCell_mm &&
                        (has_up || up == 0);
  return in_range ? nullptr : "maplet holds values out of range";
}

// Body of a layer. @param coarse  planes whose cells are blocks still: brought up to date
bool get_layer(ByteReader in, Maplet& m, std::size_t& coarse) noexcept {
  (void)in.get(2);
  const std::size_t planes = in.pop();
  const std::size_t keyframes = in.pop();
  const auto shift = static_cast<int>(in.get(1));
  if (shift != 0 && (shift != kCoarseShift || coarse > 0)) return false;
  const std::size_t first = m.planes.size();
  if (!codec::get_keyframes(in, keyframes, m) || !codec::get_planes(in, planes, m)) return false;
  CellDecoder cells{in};
  for (std::size_t i = 0; i < coarse; ++i) cells.refine(m, m.planes[i].grid);
  for (std::size_t i = first; i < m.planes.size(); ++i) cells.get(m, m.planes[i].grid, shift);
  coarse = shift == 0 ? 0 : m.planes.size();
  return true;
}

}  // namespace

Expected<std::size_t> encode(const Maplet& m, std::span<std::byte> out) noexcept {
  if (!codec::writable(m))
    return fail(ErrorCode::kBadInput, "maplet has no keyframe or odd values");
  const auto layers = plan(m);
  StaticVector<std::size_t, codec::kMaxLayers> ends;
  std::size_t size = codec::kHeaderBytes;
  for (const Layer& layer : layers) {
    size = put_layer(m, layer, size, out);
    if (size > out.size()) return fail(ErrorCode::kCapacity, "maplet does not fit");
    ends.push_back(size);
  }
  put_header(m, layers.size(), size, out);
  for (const std::size_t end : ends) {
    ByteWriter tail{out.subspan(end - kCrcBytes)};
    tail.put(crc32c(out.first(end - kCrcBytes)), kCrcBytes);
  }
  return size;
}

Expected<std::size_t> encode(const Maplet& m, std::size_t max_bytes,
                             std::span<std::byte> out) noexcept {
  const auto size = encode(m, out);
  if (!size) return size;
  const std::size_t kept = layers_within(out.first(*size), max_bytes);
  if (kept == 0) return fail(ErrorCode::kCapacity, "not even the first layer fits");
  return kept;
}

StaticVector<std::size_t, codec::kMaxLayers> layer_ends(std::span<const std::byte> bytes) noexcept {
  StaticVector<std::size_t, codec::kMaxLayers> ends;
  ByteReader header{bytes.first(std::min(bytes.size(), codec::kHeaderBytes))};
  if (header.get(4) != kMagic || header.get(1) != kVersion || header.get(2) > 0xFFFF) return ends;
  const std::size_t layers = header.get(1) & 0x7FU;
  if (header.ran_short()) return ends;
  for (std::size_t at = codec::kHeaderBytes; ends.size() < std::min(layers, codec::kMaxLayers);) {
    if (bytes.size() < at + kLayerHeadBytes + kCrcBytes) break;
    const auto size = static_cast<std::size_t>(ByteReader{bytes.subspan(at)}.get(2));
    if (size < kLayerHeadBytes + kCrcBytes || size > bytes.size() - at) break;
    at += size;
    ends.push_back(at);
  }
  return ends;
}

std::size_t layers_within(std::span<const std::byte> bytes, std::size_t max_bytes) noexcept {
  std::size_t kept = 0;
  for (const std::size_t end : layer_ends(bytes)) {
    if (end <= max_bytes) kept = end;
  }
  return kept;
}

namespace {

using LayerEnds = StaticVector<std::size_t, codec::kMaxLayers>;

// Header and checksums, all of them before anything is taken from a layer.
Expected<LayerEnds> check(std::span<const std::byte> bytes, Header& header) noexcept {
  if (bytes.size() < codec::kHeaderBytes + kLayerHeadBytes + kCrcBytes) {
    return fail(ErrorCode::kBadInput, "too short for a maplet");
  }
  ByteReader in{bytes.first(codec::kHeaderBytes)};
  const char* wrong = get_header(in, header);
  if (wrong != nullptr) return fail(ErrorCode::kBadInput, wrong);
  const auto ends = layer_ends(bytes);
  if (ends.empty() || ends.back() != bytes.size()) {
    return fail(ErrorCode::kBadInput, "maplet is cut short inside a layer, or goes on after it");
  }
  std::uint32_t crc = 0;
  std::size_t at = 0;
  for (const std::size_t end : ends) {
    crc = crc32c(bytes.subspan(at, end - kCrcBytes - at), crc);
    if (ByteReader{bytes.subspan(end - kCrcBytes)}.get(kCrcBytes) != crc) {
      return fail(ErrorCode::kBadInput, "maplet is damaged: its checksum differs");
    }
    at = end - kCrcBytes;
  }
  return ends;
}

}  // namespace

Expected<MapletKey> key_of(std::span<const std::byte> bytes) noexcept {
  Header header{};
  const auto checked = check(bytes, header);
  if (!checked) return tl::unexpected{checked.error()};
  return header.key;
}

Expected<void> decode(std::span<const std::byte> bytes, Maplet& m) noexcept {
  m.clear();
  Header header{};
  const auto checked = check(bytes, header);
  if (!checked) return tl::unexpected{checked.error()};
  const LayerEnds& ends = *checked;
  m.key = header.key;
  m.stamp = header.stamp;
  m.cell_m = header.cell_m;
  m.up = header.up;
  m.complete = ends.size() == header.layers;
  std::size_t coarse = 0;
  std::size_t at = codec::kHeaderBytes;
  for (const std::size_t end : ends) {
    if (!get_layer(ByteReader{bytes.subspan(at, end - kCrcBytes - at)}, m, coarse)) {
      return fail(ErrorCode::kBadInput, "maplet holds values out of range");
    }
    at = end;
  }
  const bool all_told = coarse == 0 && m.planes.size() == header.planes &&
                        m.keyframes.size() == header.keyframes && header.size == bytes.size();
  if (m.complete && !all_told) {
    return fail(ErrorCode::kBadInput, "maplet holds values out of range");
  }
  for (MapletPlane& plane : m.planes) m.measure_extent(plane);
  return {};
}

}  // namespace maplet
