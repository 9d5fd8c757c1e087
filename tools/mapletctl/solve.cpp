// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>

#include <algorithm>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>

#include "tools/mapletctl/command.hpp"
#include "tools/solve/run.hpp"

namespace maplet::ctl {
namespace {

using Json = nlohmann::ordered_json;

struct Options {
  std::vector<std::string> inputs;
  graphs::SolveOptions solve;
  bool incremental = false;
  double budget_us = 0.0;
  std::string out;
  std::string trace;
};

[[nodiscard]] Json quantiles(const std::vector<graphs::StepTrace>& steps,
                             double graphs::StepTrace::*member) {
  std::vector<double> sorted;
  for (const auto& s : steps) sorted.push_back(s.*member);
  std::sort(sorted.begin(), sorted.end());
  const auto at = [&](double q) {
    if (sorted.empty()) return 0.0;
    return sorted[static_cast<std::size_t>(q * static_cast<double>(sorted.size() - 1) + 0.5)];
  };
  return {{"p50", at(0.5)}, {"p99", at(0.99)}, {"max", at(1.0)}};
}

void write_trace(const std::string& path, const graphs::SolveOutcome& outcome) {
  std::ofstream out{path};
  out << "step,wall_us,cpu_us,nodes,factors,affected,iterations,chi2\n";
  int k = 0;
  for (const auto& s : outcome.steps)
    out << fmt::format("{},{:.1f},{:.1f},{},{},{},{},{:.9g}\n", k++, s.wall_us, s.cpu_us, s.nodes,
                       s.factors, s.affected, s.iterations, s.chi2);
  if (!out.flush()) throw Failure{path + ": cannot be written; is the folder there, and space?"};
}

[[nodiscard]] graphs::GraphFile read(const Options& options) {
  graphs::GraphFile graph;
  int file = 0;
  for (const std::string& path : options.inputs) graphs::read_graph(path, file++, graph);
  for (const auto& c : graph.complaints)
    fmt::print(stderr, "mapletctl: {}:{}: {}; left out\n", options.inputs[c.file], c.line, c.what);
  if (graph.planar && graph.spatial)
    throw Failure{options.inputs[0] + ": SE2 and SE3 in one graph; solve them apart"};
  if (graph.edges.empty())
    throw Failure{options.inputs[0] +
                  ": no edge in it; is it g2o (EDGE_SE2, EDGE_SE3:QUAT), pyfg or MRCLAM?"};
  return graph;
}

void run(Options options) {
  if (options.budget_us > 0.0) options.solve.budget_us = options.budget_us;
  if (options.incremental && options.solve.batch)
    throw Failure{"--incremental and --batch exclude each other", 2};
  const graphs::GraphFile graph = read(options);
  const graphs::SolveOutcome outcome = graphs::solve(graph, options.solve);
  if (!options.trace.empty()) write_trace(options.trace, outcome);
  if (!options.out.empty()) {
    std::ofstream out{options.out};
    graphs::write_g2o(out, outcome.solution);
    if (!out.flush()) throw Failure{options.out + ": cannot be written; is the folder there?"};
  }
  Json rejected = Json::array();
  for (const auto& e : outcome.rejected) rejected.push_back({e.a, e.b, e.line});
  Json line{{"chi2", outcome.chi2},
            {"f_log", outcome.f_log},
            {"steps", outcome.steps.size()},
            {"total_ms", outcome.total_ms},
            {"step_us", quantiles(outcome.steps, &graphs::StepTrace::wall_us)},
            {"step_cpu_us", quantiles(outcome.steps, &graphs::StepTrace::cpu_us)},
            {"arena_bytes", outcome.arena_bytes},
            {"heap_allocations", outcome.heap_allocations},
            {"accepted", outcome.accepted},
            {"rejected", outcome.rejected.size()},
            {"rejected_edges", rejected},
            {"nodes", outcome.solution.vertices.size()},
            {"groups", outcome.groups},
            {"bad_lines", graph.bad_lines},
            {"unknown_lines", graph.unknown_lines},
            {"bad_edges", outcome.bad_edges},
            {"lost_edges", outcome.lost_edges},
            {"contracted", outcome.contracted},
            {"dropped_factors", outcome.dropped_factors},
            {"damped_pivots", outcome.damped_pivots},
            {"overflows", outcome.overflows},
            {"factor_blocks", outcome.live_blocks}};
  if (const auto& accuracy = outcome.accuracy) {
    line["ate_rms_m"] = accuracy->ate_rms_m;
    line["odometry_ate_rms_m"] = accuracy->odometry_ate_rms_m;
    line["poses_with_truth"] = accuracy->poses;
    line["points_rms_m"] = accuracy->points_rms_m;
    line["points_with_truth"] = accuracy->points;
  }
  fmt::print("{}\n", line.dump());
}

}  // namespace

void add_solve(Command app) {
  auto options = std::make_shared<Options>();
  const Command c = app.add_command(
      "solve", "Solves pose graphs with the skeleton's engine; the last line is JSON");
  c.add_option("INPUT", options->inputs,
               "g2o or .pyfg files, several are several agents of one graph; or an MRCLAM folder")
      .required()
      .type_name("FILE|DIR");
  c.add_flag("--incremental", options->incremental,
             "A pose at a time with its edges, in time order (the default)");
  c.add_flag("--batch", options->solve.batch, "All at once, from the file's own vertices");
  c.add_flag("--robust", options->solve.robust, "Decide which closures to believe");
  c.add_option("--budget-us", options->budget_us, "Thread CPU time a step may take").positive();
  c.add_option("--idle-steps", options->solve.idle_steps, "Steps after the last pose")
      .non_negative();
  c.add_option("--max-nodes", options->solve.max_nodes, "Nodes kept; sized from the file if 0")
      .non_negative();
  c.add_option("--out", options->out, "Write the solved graph as g2o").type_name("FILE");
  c.add_option("--trace", options->trace, "Write a line for each step").type_name("FILE.csv");
  static bool json_anyway = false;
  c.add_flag("--json", json_anyway, "The last line is JSON anyway");
  c.run([options] { run(*options); });
}

}  // namespace maplet::ctl
