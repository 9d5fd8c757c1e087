// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "tests/fuzz/fuzz.hpp"
#include "tools/solve/graph_file.hpp"

/// Files of a folder one after the other, each ended by a line `---`: barcodes, then each robot's
/// odometry, measurements, groundtruth.
int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace maplet;
  constexpr std::size_t kMostTexts = 16;
  std::string_view rest = fuzz::text(data, size);
  std::vector<std::string> texts;
  while (!rest.empty() && texts.size() < kMostTexts) {
    const auto end = std::min(rest.find("---\n"), rest.size());
    texts.emplace_back(rest.substr(0, end));
    rest.remove_prefix(std::min(end + 4, rest.size()));
  }
  graphs::MrclamTexts folder;
  if (!texts.empty()) folder.barcodes = texts[0];
  for (std::size_t k = 1; k + 2 < texts.size(); k += 3)
    folder.robots.push_back({texts[k], texts[k + 1], texts[k + 2]});
  graphs::GraphFile graph;
  graphs::read_mrclam(folder, 0, graph);
  fuzz::require(graph.complaints.size() <= graphs::GraphFile::kMaxComplaints,
                "complaints are bounded");
  for (const auto& e : graph.edges) {
    fuzz::require(e.information.allFinite() && e.z.t.allFinite(), "an edge is finite");
    fuzz::require(e.kind == FactorKind::kBetween || e.range_m >= 0.0, "a range is one");
  }
  return 0;
}
