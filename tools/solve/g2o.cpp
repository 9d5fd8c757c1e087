// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>

#include <cmath>
#include <ostream>

#include "tools/solve/words.hpp"

namespace maplet::graphs {
namespace {

struct Tag {
  std::string_view name;
  bool planar;
  bool vertex;
  FactorKind kind;  ///< of an edge; a vertex's kPosition: a point
};
constexpr std::array kTags{
    Tag{"VERTEX_SE2", true, true, FactorKind::kBetween},
    Tag{"VERTEX_SE3:QUAT", false, true, FactorKind::kBetween},
    Tag{"VERTEX_XY", true, true, FactorKind::kPosition},
    Tag{"EDGE_SE2", true, false, FactorKind::kBetween},
    Tag{"EDGE_SE3:QUAT", false, false, FactorKind::kBetween},
    Tag{"EDGE_SE2_XY", true, false, FactorKind::kPosition},
    Tag{"EDGE_RANGE_SE2_XY", true, false, FactorKind::kRange},
    Tag{"EDGE_BEARING_SE2_XY", true, false, FactorKind::kBearing},
};

const char* read_between(Words& words, bool planar, Edge& edge) {
  if (const char* wrong = read_pose(words, planar, edge.z)) return wrong;
  if (!planar) return words.symmetric(edge.information, 6);
  Eigen::Matrix3d small;
  if (const char* wrong = words.symmetric(small, 3)) return wrong;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) edge.information(kPlanar[r], kPlanar[c]) = small(r, c);
  return nullptr;
}

const char* read_sight(Words& words, Edge& edge) {
  const char* wrong = nullptr;
  if (edge.kind == FactorKind::kPosition) {
    if ((wrong = words.numbers(edge.z.t.data(), 2)) != nullptr) return wrong;
    return words.symmetric(edge.information, 2);
  }
  const bool range = edge.kind == FactorKind::kRange;
  if ((wrong = words.numbers(range ? &edge.range_m : &edge.bearing_rad, 1)) != nullptr)
    return wrong;
  if (range && edge.range_m < 0.0) return "the range is negative";
  const int row = range ? 0 : 1;
  return words.numbers(&edge.information(row, row), 1);
}

const char* read_vertex(Words& words, const Tag& tag, int file, int line, GraphFile& graph) {
  Vertex vertex;
  if (!words.read(vertex.id)) return "the vertex's number is malformed";
  const bool point = tag.kind == FactorKind::kPosition;
  const char* wrong =
      point ? words.numbers(vertex.pose.t.data(), 2) : read_pose(words, tag.planar, vertex.pose);
  if (wrong != nullptr) return wrong;
  if (point) graph.points.insert(vertex.id);
  vertex.file = file;
  vertex.line = line;
  graph.vertices.push_back(vertex);
  return nullptr;
}

const char* read_line(std::string_view line, GraphFile& graph, Edge& edge) {
  Words words{line};
  const std::string_view name = words.next();
  if (name.empty() || name.front() == '#') return nullptr;
  const auto* tag =
      std::find_if(kTags.begin(), kTags.end(), [&](const Tag& t) { return t.name == name; });
  if (tag == kTags.end()) {
    graph.note_unknown(name);
    return nullptr;
  }
  const char* wrong = nullptr;
  if (tag->vertex) {
    wrong = read_vertex(words, *tag, edge.file, edge.line, graph);
  } else {
    edge.kind = tag->kind;
    if (!words.read(edge.a) || !words.read(edge.b)) return "a vertex's number is malformed";
    const bool between = edge.kind == FactorKind::kBetween;
    wrong = between ? read_between(words, tag->planar, edge) : read_sight(words, edge);
    if (wrong == nullptr) graph.edges.push_back(edge);
    if (wrong == nullptr && !between) graph.points.insert(edge.b);
  }
  if (wrong == nullptr) (tag->planar ? graph.planar : graph.spatial) = true;
  return wrong;
}

}  // namespace

const char* read_pose(Words& words, bool planar, Se3& pose) {
  std::array<double, 7> v{};
  if (const char* wrong = words.numbers(v.data(), planar ? 3 : 7)) return wrong;
  if (planar) {
    pose.t = {v[0], v[1], 0.0};
    pose.q = Eigen::Quaterniond{std::cos(0.5 * v[2]), 0.0, 0.0, std::sin(0.5 * v[2])};
    return nullptr;
  }
  pose.t = {v[0], v[1], v[2]};
  pose.q = Eigen::Quaterniond{v[6], v[3], v[4], v[5]};
  const double norm = pose.q.norm();
  if (!(std::abs(norm - 1.0) < 0.1)) return "the quaternion is not of length 1";
  pose.q.coeffs() /= norm;
  return nullptr;
}

void complain(GraphFile& graph, int file, int line, const char* what, const std::string& part) {
  constexpr int kOfAKind = 3;
  ++graph.bad_lines;
  Complaint* last = nullptr;
  int same = 0;
  for (Complaint& c : graph.complaints) {
    if (c.file != file || c.part != part || std::string_view{c.what} != what) continue;
    last = &c;
    ++same;
  }
  if (same >= kOfAKind) {
    ++last->more;
  } else if (graph.complaints.size() < GraphFile::kMaxComplaints) {
    graph.complaints.push_back({file, line, what, part});
  }
}

void read_g2o(std::string_view text, int file, GraphFile& graph) {
  read_lines(text, file, graph, read_line);
}

namespace {

std::string numbers_of(const Edge& e, bool planar) {
  std::string out;
  const auto add = [&](double v) { out += fmt::format(" {}", v); };
  const auto triangle = [&](int n, auto&& at) {
    for (int r = 0; r < n; ++r)
      for (int c = r; c < n; ++c) add(at(r, c));
  };
  if (e.kind == FactorKind::kPosition) {
    const int n = planar ? 2 : 3;
    for (int i = 0; i < n; ++i) add(e.z.t[i]);
    triangle(n, [&](int r, int c) { return e.information(r, c); });
  } else if (planar) {
    triangle(3, [&](int r, int c) { return e.information(kPlanar[r], kPlanar[c]); });
  } else {
    triangle(6, [&](int r, int c) { return e.information(r, c); });
  }
  return out;
}

}  // namespace

void write_g2o(std::ostream& out, const GraphFile& graph) {
  const bool planar = graph.planar;
  const auto pose = [&](const Se3& p) {
    if (planar)
      return fmt::format("{} {} {}", p.t.x(), p.t.y(), 2.0 * std::atan2(p.q.z(), p.q.w()));
    return fmt::format("{} {} {} {} {} {} {}", p.t.x(), p.t.y(), p.t.z(), p.q.x(), p.q.y(), p.q.z(),
                       p.q.w());
  };
  const char* kind = planar ? "SE2" : "SE3:QUAT";
  for (const auto& [id, seconds] : graph.stamps_s)
    out << fmt::format("# STAMP {} {}\n", id, seconds);
  for (const Vertex& v : graph.vertices) {
    if (!graph.points.contains(v.id)) {
      out << "VERTEX_" << kind << ' ' << v.id << ' ' << pose(v.pose) << '\n';
    } else if (planar) {
      out << fmt::format("VERTEX_XY {} {} {}\n", v.id, v.pose.t.x(), v.pose.t.y());
    } else {
      out << fmt::format("VERTEX_TRACKXYZ {} {} {} {}\n", v.id, v.pose.t.x(), v.pose.t.y(),
                         v.pose.t.z());
    }
  }
  const char* from = planar ? "SE2_XY" : "SE3_XYZ";
  for (const Edge& e : graph.edges) {
    if (e.kind == FactorKind::kPrior) continue;  // g2o has none
    if (e.kind == FactorKind::kBetween) {
      out << "EDGE_" << kind << ' ' << e.a << ' ' << e.b << ' ' << pose(e.z)
          << numbers_of(e, planar) << '\n';
    } else if (e.kind == FactorKind::kPosition) {
      out << fmt::format("EDGE_{} {} {}{}\n", from, e.a, e.b, numbers_of(e, planar));
    }
    if (e.kind == FactorKind::kRange || e.kind == FactorKind::kRangeBearing)
      out << fmt::format("EDGE_RANGE_{} {} {} {} {}\n", from, e.a, e.b, e.range_m,
                         e.information(0, 0));
    if (e.kind == FactorKind::kBearing || e.kind == FactorKind::kRangeBearing)
      out << fmt::format("EDGE_BEARING_{} {} {} {} {}\n", from, e.a, e.b, e.bearing_rad,
                         e.information(1, 1));
  }
}

}  // namespace maplet::graphs
