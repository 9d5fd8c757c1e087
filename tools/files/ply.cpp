// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/files/ply.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <string>

namespace maplet::files {
namespace {

// Okabe and Ito's palette without black: told apart by colour-blind eyes too.
constexpr Rgb kPalette[] = {{86, 180, 233}, {230, 159, 0}, {0, 158, 115}, {204, 121, 167},
                            {0, 114, 178},  {213, 94, 0},  {240, 228, 66}};

static_assert(std::endian::native == std::endian::little, "PLY is written as the memory holds it");

template <class T>
void append(std::string& out, const T& value) {
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  out.append(bytes, sizeof(T));
}

}  // namespace

Rgb colour_of(std::size_t maplet, const Surface& surface) noexcept {
  const double light =
      surface.mean_gray >= 0.0F
          ? surface.mean_gray / 255.0
          : 0.5 + 0.3 * surface.plane.n.dot(Eigen::Vector3d{0.45, -0.8, -0.4}.normalized());
  const double factor = 0.55 + 0.6 * light;
  const Rgb base = kPalette[maplet % std::size(kPalette)];
  const auto shade = [factor](std::uint8_t channel) {
    return static_cast<std::uint8_t>(std::clamp(std::lround(channel * factor), 0L, 255L));
  };
  return {shade(base.r), shade(base.g), shade(base.b)};
}

void PlyMesh::add(const Surface& surface, Rgb colour) {
  for (const Strip& strip : surface.strips) {
    const Eigen::Vector3d corners[] = {strip.corner, strip.corner + strip.along,
                                       strip.corner + strip.along + strip.across,
                                       strip.corner + strip.across};
    for (const Eigen::Vector3d& p : corners) {
      vertices_.push_back(
          {{static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())},
           colour});
    }
  }
}

void PlyMesh::write(const std::filesystem::path& file) const {
  std::string out = fmt::format(
      "ply\nformat binary_little_endian 1.0\ncomment mapletd\n"
      "element vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\n"
      "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
      vertices_.size(), quads());
  for (const Vertex& vertex : vertices_) {
    for (const float coordinate : vertex.position) append(out, coordinate);
    append(out, vertex.colour);
  }
  for (std::size_t quad = 0; quad < quads(); ++quad) {
    append(out, std::uint8_t{4});
    for (std::size_t corner = 0; corner < 4; ++corner) {
      append(out, static_cast<std::int32_t>(4 * quad + corner));
    }
  }
  std::ofstream stream{file, std::ios::binary};
  stream.write(out.data(), static_cast<std::streamsize>(out.size()));
  stream.close();
  if (!stream) {
    throw std::runtime_error{fmt::format("cannot write {}: {}; make room, or choose another folder",
                                         file.string(), std::strerror(errno))};
  }
}

}  // namespace maplet::files
