// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "tools/files/surface.hpp"

namespace maplet::files {

struct Rgb {
  std::uint8_t r = 0, g = 0, b = 0;
};

/// The colour of the n-th maplet (of the palette, round and round), lighter or darker with the
/// surface's gray value where there is one and with its direction where there is none.
[[nodiscard]] Rgb colour_of(std::size_t maplet, const Surface& surface) noexcept;

/// A mesh of coloured quads, written as binary little-endian PLY: what MeshLab, CloudCompare and
/// Open3D show.
class PlyMesh {
 public:
  /// One quad for each strip.
  void add(const Surface& surface, Rgb colour);
  [[nodiscard]] std::size_t quads() const noexcept { return vertices_.size() / 4; }

  /// @throws std::runtime_error  naming the file, when it cannot be written
  void write(const std::filesystem::path& file) const;

 private:
  struct Vertex {
    std::array<float, 3> position;
    Rgb colour;
  };
  std::vector<Vertex> vertices_;  ///< four for each quad, anticlockwise seen from the normal's side
};

}  // namespace maplet::files
