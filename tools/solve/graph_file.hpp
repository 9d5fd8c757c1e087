// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <iosfwd>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "core/geometry/se3.hpp"
#include "core/skeleton/graph.hpp"

namespace maplet::graphs {

/// A pose graph as files carry it. Planar ones use x, y and the rotation about z alone. Ids are
/// gtsam's keys where a file has symbols: the letter in the top byte, the number below.
struct Vertex {
  std::uint64_t id = 0;
  Se3 pose;
  int file = 0;
  int line = 0;
};

struct Edge {
  std::uint64_t a = 0;
  std::uint64_t b = 0;
  FactorKind kind = FactorKind::kBetween;
  Se3 z;  ///< T_a_b as measured; a position in its t; a prior's pose
  double range_m = 0.0;
  double bearing_rad = 0.0;  ///< planar
  /// Between and prior: planar ones use rows and columns 0, 1, 5 (x, y, theta). A sight's rows as
  /// core/skeleton/measure.hpp has them.
  Matrix6d information = Matrix6d::Zero();
  int file = 0;
  int line = 0;
};

/// A line that was not taken, and why.
struct Complaint {
  int file = 0;
  int line = 0;
  const char* what = "";
  std::string part;        ///< of a folder: the file in it
  std::uint64_t more = 0;  ///< further lines of that file of which the same is to be said
};

struct GraphFile {
  bool planar = false;
  bool spatial = false;
  std::vector<Vertex> vertices;
  std::vector<Edge> edges;
  std::set<std::uint64_t> points;            ///< ids of places without an orientation
  std::map<std::uint64_t, double> stamps_s;  ///< of poses, where the file has times
  std::map<std::uint64_t, Se3> truth;        ///< where the file has it: never used to solve
  std::vector<Complaint> complaints;         ///< the first kMaxComplaints, three of a kind
  std::uint64_t bad_lines = 0;
  std::uint64_t unknown_lines = 0;  ///< tags that are not for us
  std::string unknown_tag;          ///< the first of them

  void note_unknown(std::string_view tag) {
    if (unknown_lines++ > 0) return;
    for (const char c : tag.substr(0, 40)) unknown_tag += c > ' ' && c <= '~' ? c : '?';
  }
  static constexpr std::size_t kMaxComplaints = 100;
};

/// Reads g2o text (VERTEX_SE2, EDGE_SE2, VERTEX_SE3:QUAT, EDGE_SE3:QUAT; in the plane also
/// VERTEX_XY, EDGE_SE2_XY, EDGE_RANGE_SE2_XY, EDGE_BEARING_SE2_XY) and appends it. Never throws on
/// content: a line that makes no sense is complained of and left out.
void read_g2o(std::string_view text, int file, GraphFile& graph);

/// Reads .pyfg text: odometry, priors, ranges and positions with their covariances. Its vertices
/// are the truth. As read_g2o.
void read_pyfg(std::string_view text, int file, GraphFile& graph);

/// The texts of an MRCLAM folder.
struct MrclamTexts {
  struct Robot {
    std::string odometry;
    std::string measurements;
    std::string groundtruth;  ///< may be empty
  };
  std::string barcodes;
  std::string landmarks;  ///< their groundtruth; may be empty
  std::vector<Robot> robots;
};

/// Odometry merged to 1 Hz, what the robots see of each other and of the landmarks as ranges with
/// bearings. Robot r's pose at second k after the first one's start is 'A' + r - 1, k; landmark n
/// is 'L', n. As read_g2o.
void read_mrclam(const MrclamTexts& texts, int file, GraphFile& graph);

/// By what the path names: a folder is MRCLAM, *.pyfg is pyfg, else g2o.
/// @throws std::runtime_error when it cannot be read
void read_graph(const std::string& path, int file, GraphFile& graph);

/// Writes vertices and edges as g2o text that read_g2o reads back bit for bit. A range with bearing
/// becomes two edges. Poses with a time are told by lines `# STAMP id seconds`.
void write_g2o(std::ostream& out, const GraphFile& graph);

/// gtsam's key of a symbol.
[[nodiscard]] constexpr std::uint64_t symbol(char letter, std::uint64_t number) {
  return (std::uint64_t{static_cast<unsigned char>(letter)} << 56) | number;
}

}  // namespace maplet::graphs
