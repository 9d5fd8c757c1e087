// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <iosfwd>
#include <string>
#include <string_view>
#include <vector>

#include "core/geometry/se3.hpp"

namespace maplet::graphs {

/// A pose graph as files carry it. Planar ones use x, y and the rotation about z alone.
struct Vertex {
  std::uint64_t id = 0;
  Se3 pose;
};

struct Edge {
  std::uint64_t a = 0;
  std::uint64_t b = 0;
  Se3 z;                 ///< T_a_b as measured
  Matrix6d information;  ///< planar: rows and columns 0, 1, 5 hold x, y, theta
  int file = 0;
  int line = 0;
};

/// A line that was not taken, and why.
struct Complaint {
  int file = 0;
  int line = 0;
  const char* what = "";
};

struct GraphFile {
  bool planar = false;
  bool spatial = false;
  std::vector<Vertex> vertices;
  std::vector<Edge> edges;
  std::vector<Complaint> complaints;  ///< the first kMaxComplaints
  std::uint64_t bad_lines = 0;
  std::uint64_t unknown_lines = 0;  ///< tags that are not for us
  static constexpr std::size_t kMaxComplaints = 100;
};

/// Reads g2o text (VERTEX_SE2, EDGE_SE2, VERTEX_SE3:QUAT, EDGE_SE3:QUAT) and appends it. Never
/// throws on content: a line that makes no sense is complained of and left out.
void read_g2o(std::string_view text, int file, GraphFile& graph);

/// @throws std::runtime_error when the file cannot be read
void read_g2o_file(const std::string& path, int file, GraphFile& graph);

/// Writes vertices and edges as g2o text that read_g2o reads back bit for bit.
void write_g2o(std::ostream& out, const GraphFile& graph);

}  // namespace maplet::graphs
