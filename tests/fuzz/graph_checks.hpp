// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "tests/fuzz/fuzz.hpp"
#include "tools/solve/graph_file.hpp"

namespace maplet::fuzz {

/// What holds of a graph that a reader of poses made of any bytes.
inline void check_graph(const graphs::GraphFile& graph) {
  require(graph.complaints.size() <= graphs::GraphFile::kMaxComplaints, "complaints are bounded");
  require(graph.complaints.size() <= graph.bad_lines, "a complaint is a bad line");
  for (const auto& e : graph.edges) {
    require(e.information.allFinite() && e.z.t.allFinite(), "an edge is finite");
    require(std::abs(e.z.q.norm() - 1.0) < 1e-9, "a rotation is of length 1");
  }
  for (const auto& v : graph.vertices) require(v.pose.t.allFinite(), "a vertex is finite");
}

}  // namespace maplet::fuzz
