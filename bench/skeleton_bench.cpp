// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// What the skeleton costs on public graphs, step by step; beside a peer that runs in turn with it.
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <set>
#include <sstream>
#include <string>
#include <utility>
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

/// The microseconds in the last column of CSV lines, a step a line.
Steps read_peer(std::istream& in) {
  Steps steps;
  for (std::string line; std::getline(in, line);) {
    std::istringstream number{line.substr(line.rfind(',') + 1)};
    double us = 0.0;
    if (number >> us) steps.us.push_back(us);
  }
  return steps;
}

/// What a peer's program says about a graph on its standard output.
Steps run_peer(const std::string& program, const std::string& graph) {
  const std::string command = program + " '" + graph + "'";
  std::unique_ptr<FILE, int (*)(FILE*)> pipe{popen(command.c_str(), "r"), pclose};
  std::stringstream said;
  std::array<char, 4096> buffer{};
  while (pipe && std::fgets(buffer.data(), buffer.size(), pipe.get()) != nullptr)
    said << buffer.data();
  return read_peer(said);
}

/// The least of several runs, step by step: what else the machine did is left out, of both alike.
void keep_least(Steps& least, const Steps& next) {
  if (least.us.size() != next.us.size()) {
    least = next;
    return;
  }
  for (std::size_t i = 0; i < next.us.size(); ++i) least.us[i] = std::min(least.us[i], next.us[i]);
}

/// Every step's time on a logarithmic scale, 1 us to 1 s; the peer's in gray.
void plot(const std::string& path, const std::string& name, const Steps& own, const Steps& peer) {
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
    std::set<std::pair<int, int>> dots;  // of whole pixels: thousands of steps fall together
    for (std::size_t i = 0; i < steps.us.size(); ++i) {
      const double x = kWidth * static_cast<double>(i) / static_cast<double>(steps.us.size());
      const double y = kHeight * (1.0 - std::log10(std::max(steps.us[i], 1.0)) / 6.0);
      dots.emplace(static_cast<int>(x), static_cast<int>(y));
    }
    out << "<path d='";
    for (const auto& [x, y] : dots) out << 'M' << x << ' ' << y << "h1";
    out << fmt::format("' stroke='{}' stroke-width='2'/>\n", colour);
  };
  out << fmt::format("<text x='8' y='12'>{}: thread CPU of each step, ours blue{}</text>\n", name,
                     peer.us.empty() ? "" : ", the peer's gray");
  draw(peer, "#aaa");
  draw(own, "#06c");
  out << "</svg>\n";
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"The skeleton's engine on pose graphs: time a step, memory, the objective"};
  std::vector<std::string> graphs;
  std::string peer_file;
  std::string peer_command;
  int repeat = 1;
  std::string plot_file;
  SolveOptions options;
  double budget_us = 0.0;
  app.add_option("GRAPH", graphs, "g2o, .pyfg or an MRCLAM folder")->required();
  app.add_option("--budget-us", budget_us, "Thread CPU time a step may take");
  app.add_option("--idle-steps", options.idle_steps, "Steps after the last pose");
  app.add_option("--max-nodes", options.max_nodes, "Nodes kept");
  app.add_flag("--robust", options.robust, "Decide which closures to believe");
  app.add_option("--peer", peer_file, "CSV whose last column is a peer's microseconds a step");
  app.add_option("--peer-command", peer_command,
                 "Program that is given a graph and prints such lines; runs in turn with ours");
  app.add_option("--repeat", repeat, "Runs of each in turn; the least time of each step counts")
      ->check(CLI::Range(1, 100));
  app.add_option("--plot", plot_file, "SVG of every step; {} is the graph's name");
  CLI11_PARSE(app, argc, argv);
  if (budget_us > 0.0) options.budget_us = budget_us;
  fmt::print("{:<28}{:>8}{:>9}{:>9}{:>9}{:>14}{:>14}{:>8}{:>6}\n", "graph", "total s", "p50 us",
             "p99 us", "max us", "chi2", "F_log", "B/pose", "heap");
  for (const std::string& path : graphs) {
    GraphFile graph;
    maplet::graphs::read_graph(path, 0, graph);
    SolveOutcome outcome;
    Steps own;
    Steps peer;
    for (int k = 0; k < repeat; ++k) {
      outcome = maplet::graphs::solve(graph, options);
      Steps run;
      for (const auto& s : outcome.steps) run.us.push_back(s.cpu_us);
      keep_least(own, run);
      if (!peer_command.empty()) keep_least(peer, run_peer(peer_command, path));
    }
    if (!peer_file.empty()) {
      std::ifstream in{peer_file};
      peer = read_peer(in);
    }
    fmt::print("{:<28}{:>8.3f}{:>9.1f}{:>9.1f}{:>9.1f}{:>14.6f}{:>14.6f}{:>8}{:>6}\n",
               path.substr(path.find_last_of('/', path.size() - 2) + 1), own.total_s(),
               own.quantile(0.5), own.quantile(0.99), own.quantile(1.0), outcome.chi2,
               outcome.f_log,
               outcome.arena_bytes / std::max<std::size_t>(1, outcome.solution.vertices.size()),
               outcome.heap_allocations);
    if (!peer.us.empty()) {
      fmt::print(
          "{:<28}{:>8.3f}{:>9.1f}{:>9.1f}{:>9.1f}   ratios: total {:.3f}, p99 {:.3f}, max {:.3f}\n",
          "  peer", peer.total_s(), peer.quantile(0.5), peer.quantile(0.99), peer.quantile(1.0),
          own.total_s() / peer.total_s(), own.quantile(0.99) / peer.quantile(0.99),
          own.quantile(1.0) / peer.quantile(1.0));
    }
    if (plot_file.empty()) continue;
    const std::string name = std::filesystem::path{path}.stem().string();
    std::string file = plot_file;
    if (const auto at = file.find("{}"); at != std::string::npos) file.replace(at, 2, name);
    plot(file, name, own, peer);
  }
  return 0;
}
