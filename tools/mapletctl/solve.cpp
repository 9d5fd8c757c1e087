// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "core/base/arena_exhausted.hpp"
#include "daemon/progress.hpp"
#include "tools/mapletctl/command.hpp"
#include "tools/solve/fill.hpp"
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

/// A file that write(stream) fills.
template <class Write>
void write_file(const std::string& path, Write&& write) {
  errno = 0;
  std::ofstream out{path};
  write(out);
  if (!out.flush()) throw Failure{path + ": cannot be written: " + std::strerror(errno)};
}

void write_trace(std::ostream& out, const graphs::SolveOutcome& outcome) {
  out << "step,wall_us,cpu_us,nodes,factors,affected,iterations,chi2\n";
  int k = 0;
  for (const auto& s : outcome.steps)
    out << fmt::format("{},{:.1f},{:.1f},{},{},{},{},{:.9g}\n", k++, s.wall_us, s.cpu_us, s.nodes,
                       s.factors, s.affected, s.iterations, s.chi2);
}

/// What is written may not be what is read, nor the other thing that is written.
void refuse_overwriting(const Options& options) {
  namespace fs = std::filesystem;
  const auto same = [](const std::string& a, const std::string& b) {
    std::error_code none;
    if (a.empty() || b.empty() || fs::is_character_file(a, none)) return false;
    return fs::equivalent(a, b, none) || fs::weakly_canonical(fs::absolute(a, none), none) ==
                                             fs::weakly_canonical(fs::absolute(b, none), none);
  };
  for (const auto& [name, path] : {std::pair{"--out", options.out}, {"--trace", options.trace}})
    for (const std::string& input : options.inputs)
      if (same(path, input))
        throw Failure{fmt::format("{} {}: that is an input; name another file", name, path), 2};
  if (same(options.out, options.trace))
    throw Failure{options.out + ": --out and --trace cannot be one file", 2};
}

template <class... Args>
void say(fmt::format_string<Args...> text, Args&&... args) {
  fmt::print(stderr, "mapletctl: {}\n", fmt::format(text, std::forward<Args>(args)...));
}

/// Of two vertices of one number that say different things the first counts.
void tell_duplicates(const Options& options, const graphs::GraphFile& graph) {
  std::map<std::uint64_t, const graphs::Vertex*> first;
  std::size_t count = 0;
  for (const graphs::Vertex& v : graph.vertices) {
    const auto [at, fresh] = first.try_emplace(v.id, &v);
    const Se3& other = at->second->pose;
    if (fresh || (v.pose.t == other.t && v.pose.q.coeffs() == other.q.coeffs())) continue;
    if (++count == 1)
      say("{}:{}: vertex {} again, elsewhere; the one of {}:{} counts", options.inputs[v.file],
          v.line, v.id, options.inputs[at->second->file], at->second->line);
  }
  if (count > 1) say("{} more vertices again, elsewhere; the first ones count", count - 1);
}

[[nodiscard]] graphs::GraphFile read(const Options& options) {
  graphs::GraphFile graph;
  int file = 0;
  for (const std::string& path : options.inputs) graphs::read_graph(path, file++, graph);
  for (const auto& c : graph.complaints) {
    const std::string& input = options.inputs[c.file];
    say("{}:{}: {}; left out{}", c.part.empty() ? input : input + "/" + c.part, c.line, c.what,
        c.more > 0 ? fmt::format(", and {} more lines for that", c.more) : "");
  }
  if (graph.planar && graph.spatial)
    throw Failure{options.inputs[0] + ": SE2 and SE3 in one graph; solve them apart"};
  if (graph.edges.empty() && graph.vertices.empty())
    throw Failure{fmt::format(
        "{}: no vertex and no edge in it{}; is it g2o (EDGE_SE2, EDGE_SE3:QUAT), pyfg or MRCLAM?",
        options.inputs[0],
        graph.unknown_lines > 0 ? " (lines begin with " + graph.unknown_tag + ")" : "")};
  if (graph.unknown_lines > 0)
    say("{} lines of kinds that are not read, the first is {}; left out", graph.unknown_lines,
        graph.unknown_tag);
  tell_duplicates(options, graph);
  return graph;
}

[[nodiscard]] graphs::SolveOutcome solve(const graphs::GraphFile& graph, Options& options) {
  std::optional<Progress> bar;
  const char* shown = nullptr;
  options.solve.progress = [&](const char* what, std::uint64_t done, auto total) {
    if (shown != what) bar.emplace(shown = what, total);
    bar->show(done);
  };
  const auto short_of = [&](const std::string& what) {
    return Failure{fmt::format(
        "{}: {} edges and {} idle steps want more memory than there is ({}); --max-nodes keeps "
        "the graph small, fewer --idle-steps keep less of a trace",
        options.inputs[0], graph.edges.size(), options.solve.idle_steps, what)};
  };
  try {
    return graphs::solve(graph, options.solve);
  } catch (const ArenaExhausted& e) {
    throw short_of(e.what());
  } catch (const std::bad_alloc&) {
    throw short_of("the system gives no more");
  } catch (const std::length_error&) {
    throw short_of("no system has so much");
  }
}

/// What a figure alone would hide.
void tell_doubts(const Options& options, const graphs::GraphFile& graph,
                 const graphs::SolveOutcome& outcome) {
  const auto& bad = outcome.named_bad_edges;
  for (const auto& b : bad) {
    const graphs::Edge& e = graph.edges[b.edge];
    say("{}:{}: edge {} - {}: {}; left out", options.inputs[e.file], e.line, e.a, e.b, b.why);
  }
  if (outcome.bad_edges > bad.size())
    say("{} more edges left out for such reasons", outcome.bad_edges - bad.size());
  if (outcome.lost_edges > 0)
    say("{} edges lead to poses that were taken out for want of room and are forgotten; left out",
        outcome.lost_edges);
  // A few happen while steps are wild, and are eliminated anew.
  if (outcome.damped_pivots > 10 + outcome.solution.vertices.size() / 100)
    say("{} pivots of the factorisation were not positive and were damped: information beyond what "
        "the arithmetic tells apart; the solution may be far off",
        outcome.damped_pivots);
  if (!std::isfinite(outcome.chi2))
    say("chi2 is beyond all numbers (null): an error is too large for its information");
}

void run(Options options) {
  if (options.budget_us > 0.0) options.solve.budget_us = options.budget_us;
  if (options.incremental && options.solve.batch)
    throw Failure{"--incremental and --batch exclude each other", 2};
  if (options.solve.max_nodes > 0 && options.solve.max_nodes < graphs::kLeastNodes)
    throw Failure{fmt::format("--max-nodes: {} are too few; {} at least, or 0 for all",
                              options.solve.max_nodes, graphs::kLeastNodes),
                  2};
  refuse_overwriting(options);
  const graphs::GraphFile graph = read(options);
  const graphs::SolveOutcome outcome = solve(graph, options);
  tell_doubts(options, graph, outcome);
  if (!options.trace.empty())
    write_file(options.trace, [&](std::ostream& out) { write_trace(out, outcome); });
  if (!options.out.empty())
    write_file(options.out, [&](std::ostream& out) { graphs::write_g2o(out, outcome.solution); });
  Json rejected = Json::array();
  Json rejected_files = Json::array();
  for (const auto& e : outcome.rejected) {
    rejected.push_back({e.a, e.b, e.line});
    rejected_files.push_back(options.inputs[e.file]);
  }
  Json bad = Json::array();
  for (const auto& b : outcome.named_bad_edges) {
    const graphs::Edge& e = graph.edges[b.edge];
    bad.push_back({{"a", e.a},
                   {"b", e.b},
                   {"file", options.inputs[e.file]},
                   {"line", e.line},
                   {"why", b.why}});
  }
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
            {"bad_edges_named", bad},
            {"lost_edges", outcome.lost_edges},
            {"contracted", outcome.contracted},
            {"dropped_factors", outcome.dropped_factors},
            {"damped_pivots", outcome.damped_pivots},
            {"overflows", outcome.overflows},
            {"factor_blocks", outcome.live_blocks}};
  if (options.inputs.size() > 1) line["rejected_files"] = rejected_files;
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
  c.add_option("--max-nodes", options->solve.max_nodes,
               "Nodes kept, 16 at least; sized from the file if 0")
      .non_negative();
  c.add_option("--out", options->out, "Write the solved graph as g2o").type_name("FILE");
  c.add_option("--trace", options->trace, "Write a line for each step").type_name("FILE.csv");
  static bool json_anyway = false;
  c.add_flag("--json", json_anyway, "The last line is JSON anyway");
  c.run([options] { run(*options); });
}

}  // namespace maplet::ctl
