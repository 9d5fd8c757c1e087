// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tools/solve/graph_file.hpp"
#include "tools/solve/order.hpp"
#include "tools/solve/score.hpp"

namespace maplet::graphs {

struct SolveOptions {
  bool batch = false;
  bool robust = false;
  std::optional<double> budget_us;  ///< thread CPU time of a step
  int idle_steps = 0;
  int max_nodes = 0;  ///< 0: from the file
  /// Called after each step: edges taken in, of how many; then steps, of nobody knows how many.
  std::function<void(const char* what, std::uint64_t done, std::optional<std::uint64_t> total)>
      progress;
};

/// What one step cost.
struct StepTrace {
  double wall_us = 0.0;
  double cpu_us = 0.0;
  int nodes = 0;
  int factors = 0;
  int affected = 0;
  int iterations = 0;
  double chi2 = 0.0;
};

struct SolveOutcome {
  double chi2 = 0.0;   ///< sum e^T information e, e = (t, q.vec) or (x, y, theta); accepted edges
  double f_log = 0.0;  ///< 1/2 sum e^T information e with the full logarithm
  double total_ms = 0.0;
  std::vector<StepTrace> steps;
  std::uint64_t arena_bytes = 0;
  std::uint64_t heap_allocations = 0;
  std::uint64_t accepted = 0;
  std::vector<Edge> rejected;
  std::uint64_t bad_edges = 0;
  std::vector<BadEdge> named_bad_edges;  ///< the first of them
  std::uint64_t lost_edges = 0;          ///< to poses that were taken out and forgotten
  std::uint64_t contracted = 0;          ///< poses taken out for want of room
  std::uint64_t dropped_factors = 0;     ///< for want of room
  std::uint64_t damped_pivots = 0;
  std::uint64_t overflows = 0;
  int groups = 0;
  int live_blocks = 0;
  std::optional<Accuracy> accuracy;  ///< where the file has the truth
  GraphFile solution;
};

/// Solves a graph with the skeleton's engine, in the plane or in space as the file says.
[[nodiscard]] SolveOutcome solve(const GraphFile& graph, const SolveOptions& options);

}  // namespace maplet::graphs
