// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>

#include <charconv>
#include <cmath>
#include <fstream>
#include <iterator>
#include <ostream>
#include <stdexcept>

#include "tools/solve/graph_file.hpp"

namespace maplet::graphs {
namespace {

constexpr std::array<int, 3> kPlanar{0, 1, 5};  // x, y, theta among x y z rx ry rz

/// The words of one line.
class Words {
 public:
  explicit Words(std::string_view line) : rest_{line} {}

  [[nodiscard]] std::string_view next() {
    const auto from = rest_.find_first_not_of(" \t\r");
    if (from == std::string_view::npos) return rest_ = {};
    rest_.remove_prefix(from);
    const auto to = std::min(rest_.find_first_of(" \t\r"), rest_.size());
    const auto word = rest_.substr(0, to);
    rest_.remove_prefix(to);
    return word;
  }
  template <class T>
  [[nodiscard]] bool read(T& value) {
    std::string_view word = next();
    if (!word.empty() && word.front() == '+') word.remove_prefix(1);
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    return error == std::errc{} && end == word.data() + word.size() && !word.empty();
  }

 private:
  std::string_view rest_;
};

const char* read_pose(Words& words, bool planar, Se3& pose) {
  std::array<double, 7> v{};
  for (int i = 0; i < (planar ? 3 : 7); ++i) {
    if (!words.read(v[i])) return "a number is missing or malformed";
    if (!std::isfinite(v[i])) return "a number is not finite";
  }
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

const char* read_information(Words& words, bool planar, Matrix6d& information) {
  information.setZero();
  const int n = planar ? 3 : 6;
  for (int r = 0; r < n; ++r) {
    for (int c = r; c < n; ++c) {
      double v = 0.0;
      if (!words.read(v)) return "a number is missing or malformed";
      if (!std::isfinite(v)) return "a number is not finite";
      const int i = planar ? kPlanar[r] : r;
      const int j = planar ? kPlanar[c] : c;
      information(i, j) = information(j, i) = v;
    }
  }
  return nullptr;
}

const char* read_line(std::string_view line, GraphFile& graph, Edge& edge) {
  Words words{line};
  const std::string_view tag = words.next();
  if (tag.empty() || tag.front() == '#') return nullptr;
  const bool planar = tag == "VERTEX_SE2" || tag == "EDGE_SE2";
  const bool spatial = tag == "VERTEX_SE3:QUAT" || tag == "EDGE_SE3:QUAT";
  if (!planar && !spatial) {
    ++graph.unknown_lines;
    return nullptr;
  }
  const char* wrong = nullptr;
  if (tag.front() == 'V') {
    Vertex vertex;
    if (!words.read(vertex.id)) return "the vertex's number is malformed";
    if ((wrong = read_pose(words, planar, vertex.pose)) != nullptr) return wrong;
    graph.vertices.push_back(vertex);
  } else {
    if (!words.read(edge.a) || !words.read(edge.b)) return "a vertex's number is malformed";
    if ((wrong = read_pose(words, planar, edge.z)) != nullptr) return wrong;
    if ((wrong = read_information(words, planar, edge.information)) != nullptr) return wrong;
    graph.edges.push_back(edge);
  }
  (planar ? graph.planar : graph.spatial) = true;
  return nullptr;
}

}  // namespace

void read_g2o(std::string_view text, int file, GraphFile& graph) {
  for (int line = 1; !text.empty(); ++line) {
    const auto end = std::min(text.find('\n'), text.size());
    Edge edge;
    edge.file = file;
    edge.line = line;
    if (const char* wrong = read_line(text.substr(0, end), graph, edge)) {
      ++graph.bad_lines;
      if (graph.complaints.size() < GraphFile::kMaxComplaints)
        graph.complaints.push_back({file, line, wrong});
    }
    text.remove_prefix(std::min(end + 1, text.size()));
  }
}

void read_g2o_file(const std::string& path, int file, GraphFile& graph) {
  std::ifstream in{path, std::ios::binary};
  if (!in) throw std::runtime_error{path + ": cannot be opened"};
  const std::string text{std::istreambuf_iterator<char>{in}, {}};
  if (in.bad()) throw std::runtime_error{path + ": cannot be read"};
  read_g2o(text, file, graph);
}

void write_g2o(std::ostream& out, const GraphFile& graph) {
  const auto pose = [&](const Se3& p) {
    if (graph.planar) {
      return fmt::format("{} {} {}", p.t.x(), p.t.y(), 2.0 * std::atan2(p.q.z(), p.q.w()));
    }
    return fmt::format("{} {} {} {} {} {} {}", p.t.x(), p.t.y(), p.t.z(), p.q.x(), p.q.y(), p.q.z(),
                       p.q.w());
  };
  const char* kind = graph.planar ? "SE2" : "SE3:QUAT";
  for (const Vertex& v : graph.vertices)
    out << "VERTEX_" << kind << ' ' << v.id << ' ' << pose(v.pose) << '\n';
  const int n = graph.planar ? 3 : 6;
  for (const Edge& e : graph.edges) {
    out << "EDGE_" << kind << ' ' << e.a << ' ' << e.b << ' ' << pose(e.z);
    for (int r = 0; r < n; ++r)
      for (int c = r; c < n; ++c)
        out << ' '
            << fmt::format("{}", graph.planar ? e.information(kPlanar[r], kPlanar[c])
                                              : e.information(r, c));
    out << '\n';
  }
}

}  // namespace maplet::graphs
