// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tests/fuzz/graph_checks.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace maplet;
  graphs::GraphFile graph;
  graphs::read_g2o(fuzz::text(data, size), 0, graph);
  fuzz::check_graph(graph);
  return 0;
}
