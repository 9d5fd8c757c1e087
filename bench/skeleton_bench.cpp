// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// What the skeleton costs on public graphs, step by step; beside a peer's steps where they are
// given.
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "tools/solve/run.hpp"

namespace {

using maplet::graphs::GraphFile;
using maplet::graphs::SolveOptions;
using maplet::graphs::SolveOutcome;

struct Steps {
  std::vector<double> us;

  [[nodiscard]] double quantile(double q) const {
    if (us.empty()) return 0.0;
    std::vector<double> sorted = us;
    std::sort(sorted.begin(), sorted.end());
    return sorted[static_cast<std::size_t>(q * static_cast<double>(sorted.size() - 1) + 0.5)];
  }
  [[nodiscard]] double total_s() const {
    double sum = 0.0;
    for (const double v : us) sum += v;
    return 1e-6 * sum;
  }
};

/// The microseconds in the last column of a CSV file, a step a line.
Steps read_peer(const std::string& path) {
  Steps steps;
  std::ifstream in{path};
  for (std::string line; std::getline(in, line);) {
    std::istringstream number{line.substr(line.rfind(',') + 1)};
    double us = 0.0;
    if (number >> us) steps.us.push_back(us);
  }
  return steps;
}

/// Every step's time on a logarithmic scale, 1 us to 1 s; the peer's in gray.
void plot(const std::string& path, const Steps& own, const Steps& peer) {
  constexpr double kWidth = 900.0, kHeight = 360.0;
  std::ofstream out{path};
  out << fmt::format(
      "<svg xmlns='http://www.w3.org/2000/svg' viewBox='-60 -10 {} {}' font-size='12'>\n",
      kWidth + 80, kHeight + 50);
  for (int decade = 0; decade <= 6; ++decade) {
    const double y = kHeight * (1.0 - decade / 6.0);
    out << fmt::format(
        "<path d='M0 {0:.1f}H{1}' stroke='#ddd'/><text x='-6' y='{0:.1f}' text-anchor='end'>1e{2} "
        "us</text>\n",
        y, kWidth, decade);
  }
  const auto draw = [&](const Steps& steps, const char* colour) {
    for (std::size_t i = 0; i < steps.us.size(); ++i) {
      const double x = kWidth * static_cast<double>(i) / static_cast<double>(steps.us.size());
      const double y = kHeight * (1.0 - std::log10(std::max(steps.us[i], 1.0)) / 6.0);
      out << fmt::format("<circle cx='{:.1f}' cy='{:.1f}' r='1' fill='{}'/>\n", x, y, colour);
    }
  };
  draw(peer, "#aaa");
  draw(own, "#06c");
  out << "</svg>\n";
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"The skeleton's engine on pose graphs: time a step, memory, the objective"};
  std::vector<std::string> graphs;
  std::string peer_file;
  std::string plot_file;
  SolveOptions options;
  double budget_us = 0.0;
  app.add_option("GRAPH", graphs, "g2o, .pyfg or an MRCLAM folder")->required();
  app.add_option("--budget-us", budget_us, "Thread CPU time a step may take");
  app.add_option("--idle-steps", options.idle_steps, "Steps after the last pose");
  app.add_option("--max-nodes", options.max_nodes, "Nodes kept");
  app.add_flag("--robust", options.robust, "Decide which closures to believe");
  app.add_option("--peer", peer_file, "CSV whose last column is a peer's microseconds a step");
  app.add_option("--plot", plot_file, "SVG of every step");
  CLI11_PARSE(app, argc, argv);
  if (budget_us > 0.0) options.budget_us = budget_us;
  fmt::print("{:<28}{:>8}{:>9}{:>9}{:>9}{:>14}{:>14}{:>8}{:>6}\n", "graph", "total s", "p50 us",
             "p99 us", "max us", "chi2", "F_log", "B/pose", "heap");
  for (const std::string& path : graphs) {
    GraphFile graph;
    maplet::graphs::read_graph(path, 0, graph);
    const SolveOutcome outcome = maplet::graphs::solve(graph, options);
    Steps own;
    for (const auto& s : outcome.steps) own.us.push_back(s.cpu_us);
    fmt::print("{:<28}{:>8.3f}{:>9.1f}{:>9.1f}{:>9.1f}{:>14.6f}{:>14.6f}{:>8}{:>6}\n",
               path.substr(path.find_last_of('/', path.size() - 2) + 1), own.total_s(),
               own.quantile(0.5), own.quantile(0.99), own.quantile(1.0), outcome.chi2,
               outcome.f_log,
               outcome.arena_bytes / std::max<std::size_t>(1, outcome.solution.vertices.size()),
               outcome.heap_allocations);
    Steps peer;
    if (!peer_file.empty()) {
      peer = read_peer(peer_file);
      fmt::print(
          "{:<28}{:>8.3f}{:>9.1f}{:>9.1f}{:>9.1f}   ratios: total {:.3f}, p99 {:.3f}, max {:.3f}\n",
          "  peer", peer.total_s(), peer.quantile(0.5), peer.quantile(0.99), peer.quantile(1.0),
          own.total_s() / peer.total_s(), own.quantile(0.99) / peer.quantile(0.99),
          own.quantile(1.0) / peer.quantile(1.0));
    }
    if (!plot_file.empty()) plot(plot_file, own, peer);
  }
  return 0;
}
