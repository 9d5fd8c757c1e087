// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "tests/fuzz/fuzz.hpp"
#include "tools/solve/graph_file.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace maplet;
  graphs::GraphFile graph;
  graphs::read_pyfg(fuzz::text(data, size), 0, graph);
  fuzz::require(graph.complaints.size() <= graphs::GraphFile::kMaxComplaints,
                "complaints are bounded");
  fuzz::require(graph.complaints.size() <= graph.bad_lines, "a complaint is a bad line");
  for (const auto& e : graph.edges) {
    fuzz::require(e.information.allFinite() && e.z.t.allFinite(), "an edge is finite");
    fuzz::require(std::abs(e.z.q.norm() - 1.0) < 1e-9, "a rotation is of length 1");
  }
  for (const auto& v : graph.vertices) fuzz::require(v.pose.t.allFinite(), "a vertex is finite");
  return 0;
}
