// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <cctype>

#include "tools/solve/words.hpp"

namespace maplet::graphs {
namespace {

/// A letter and a number: A12. @return false for anything else
bool read_symbol(Words& words, std::uint64_t& id) {
  const std::string_view word = words.next();
  if (word.size() < 2 || std::isalpha(static_cast<unsigned char>(word.front())) == 0) return false;
  std::uint64_t number = 0;
  const char* end = word.data() + word.size();
  const auto [at, error] = std::from_chars(word.data() + 1, end, number);
  if (error != std::errc{} || at != end || (number >> 56) != 0) return false;
  id = symbol(word.front(), number);
  return true;
}

bool is_point(std::uint64_t id) { return (id >> 56) == 'L'; }

/// A covariance of n x n from the text, inverted into the rows `at` of the information.
const char* read_covariance(Words& words, int n, const int* at, Matrix6d& information) {
  Eigen::MatrixXd covariance(n, n);
  if (const char* wrong = words.symmetric(covariance, n)) return wrong;
  const Eigen::LLT<Eigen::MatrixXd> llt{covariance};
  if (llt.info() != Eigen::Success) return "the covariance is not positive definite";
  const Eigen::MatrixXd inverse = llt.solve(Eigen::MatrixXd::Identity(n, n));
  for (int r = 0; r < n; ++r)
    for (int c = 0; c < n; ++c) information(at[r], at[c]) = inverse(r, c);
  return nullptr;
}

constexpr std::array<int, 6> kInOrder{0, 1, 2, 3, 4, 5};

const char* read_vertex(Words& words, bool point, bool planar, GraphFile& graph) {
  double stamp = 0.0;
  std::uint64_t id = 0;
  if (!point && words.numbers(&stamp, 1) != nullptr) return "the time is malformed";
  if (!read_symbol(words, id)) return "the vertex's symbol is malformed";
  Se3 pose;
  const char* wrong =
      point ? words.numbers(pose.t.data(), planar ? 2 : 3) : read_pose(words, planar, pose);
  if (wrong != nullptr) return wrong;
  graph.truth[id] = pose;
  if (point) {
    graph.points.insert(id);
  } else {
    graph.stamps_s[id] = stamp;
  }
  return nullptr;
}

const char* read_measured(Words& words, bool planar, Edge& edge) {
  switch (edge.kind) {
    case FactorKind::kRange: {
      if (const char* wrong = words.numbers(&edge.range_m, 1)) return wrong;
      if (edge.range_m < 0.0) return "the range is negative";
      return read_covariance(words, 1, kInOrder.data(), edge.information);
    }
    case FactorKind::kPosition: {
      const int n = planar ? 2 : 3;
      if (const char* wrong = words.numbers(edge.z.t.data(), n)) return wrong;
      return read_covariance(words, n, kInOrder.data(), edge.information);
    }
    default: {
      if (const char* wrong = read_pose(words, planar, edge.z)) return wrong;
      return read_covariance(words, planar ? 3 : 6, planar ? kPlanar.data() : kInOrder.data(),
                             edge.information);
    }
  }
}

const char* read_edge(Words& words, bool planar, GraphFile& graph, Edge& edge) {
  double stamp = 0.0;
  if (words.numbers(&stamp, 1) != nullptr) return "the time is malformed";
  if (!read_symbol(words, edge.a)) return "a vertex's symbol is malformed";
  if (edge.kind != FactorKind::kPrior && !read_symbol(words, edge.b))
    return "a vertex's symbol is malformed";
  if (const char* wrong = read_measured(words, planar, edge)) return wrong;
  if (edge.kind == FactorKind::kPrior) edge.b = edge.a;
  if (is_point(edge.a)) return "a point measures nothing";
  if (is_point(edge.b)) graph.points.insert(edge.b);
  graph.edges.push_back(edge);
  return nullptr;
}

const char* read_line(std::string_view line, GraphFile& graph, Edge& edge) {
  Words words{line};
  const std::string_view tag = words.next();
  if (tag.empty() || tag.front() == '#') return nullptr;
  const char* wrong = nullptr;
  bool planar = tag == "VERTEX_SE2" || tag == "VERTEX_XY" || tag == "VERTEX_SE2:PRIOR" ||
                tag == "EDGE_SE2" || tag == "EDGE_SE2_XY";
  if (tag == "VERTEX_SE2" || tag == "VERTEX_SE3:QUAT") {
    wrong = read_vertex(words, false, planar, graph);
  } else if (tag == "VERTEX_XY" || tag == "VERTEX_XYZ") {
    wrong = read_vertex(words, true, planar, graph);
  } else {
    if (tag == "EDGE_SE2" || tag == "EDGE_SE3:QUAT") {
      edge.kind = FactorKind::kBetween;
    } else if (tag == "VERTEX_SE2:PRIOR" || tag == "VERTEX_SE3:QUAT:PRIOR") {
      edge.kind = FactorKind::kPrior;
    } else if (tag == "EDGE_SE2_XY" || tag == "EDGE_SE3_XYZ") {
      edge.kind = FactorKind::kPosition;
    } else if (tag == "EDGE_RANGE") {
      edge.kind = FactorKind::kRange;
    } else {
      graph.note_unknown(tag);
      return nullptr;
    }
    wrong = read_edge(words, planar, graph, edge);
    if (edge.kind == FactorKind::kRange) return wrong;  // of either dimension
  }
  if (wrong == nullptr) (planar ? graph.planar : graph.spatial) = true;
  return wrong;
}

}  // namespace

void read_pyfg(std::string_view text, int file, GraphFile& graph) {
  read_lines(text, file, graph, read_line);
}

}  // namespace maplet::graphs
