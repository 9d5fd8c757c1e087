// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/solve/run.hpp"

#include <time.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <unordered_map>

#include "core/skeleton/closure_judge.hpp"
#include "core/skeleton/linearise.hpp"
#include "core/skeleton/pose_graph.hpp"
#include "tools/solve/fill.hpp"
#include "tools/solve/heap_count.hpp"

namespace maplet::graphs {
namespace {

/// CPU time of this thread: a budget of work, whatever else the machine does.
class ThreadCpuClock final : public Clock {
 public:
  [[nodiscard]] Instant now() const noexcept override {
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return Instant{Duration{t.tv_sec * 1'000'000'000LL + t.tv_nsec}};
  }
};

constexpr std::array<int, 3> kPlanar{0, 1, 5};

Se2 to_pose(const Se3& p, PlanarSpace) {
  return Se2::from(p.t.x(), p.t.y(), 2.0 * std::atan2(p.q.z(), p.q.w()));
}
Se3 to_pose(const Se3& p, SpatialSpace) { return p; }
Se3 from_pose(const Se2& p) {
  const double half = 0.5 * p.angle();
  return {Eigen::Quaterniond{std::cos(half), 0.0, 0.0, std::sin(half)}, {p.x, p.y, 0.0}};
}
Se3 from_pose(const Se3& p) { return p; }

Eigen::Matrix3d to_block(const Matrix6d& m, PlanarSpace) {
  Eigen::Matrix3d out;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) out(r, c) = m(kPlanar[r], kPlanar[c]);
  return out;
}
Matrix6d to_block(const Matrix6d& m, SpatialSpace) { return m; }

/// g2o's error: the quaternion's vector part in place of the logarithm.
double chi2_g2o(const Factor<PlanarSpace>& f) { return f.chi2; }
double chi2_g2o(const Factor<SpatialSpace>& f) {
  Vector6d e;
  const Se3 d = Se3::exp(f.e);
  const double sign = d.q.w() < 0.0 ? -1.0 : 1.0;
  e << d.t, sign * d.q.vec();
  return e.dot(unpack<SpatialSpace>(f.information) * e);
}

/// Position in time: gtsam's keys carry the agent in the top byte, the rest counts.
std::uint64_t moment(std::uint64_t id) { return id & ((std::uint64_t{1} << 56) - 1); }

template <class Space>
class Run {
  static constexpr int kMostIdleSteps = 20'000;
  static constexpr int kMostReviews = 30;
  static constexpr int kLooksPerStep = 4;

 public:
  Run(const GraphFile& file, const SolveOptions& options) : file_{file}, options_{options} {
    prepare();
    PoseGraphLimits limits;
    limits.max_nodes = std::max<int>(2, static_cast<int>(nodes_wanted_));
    limits.max_factors = std::max<int>(1, static_cast<int>(order_.size()));
    limits.max_blocks = blocks_wanted();
    arena_.emplace(std::size_t{1} << 34);
    solver_.emplace(limits, *arena_);
    if (options.robust) judge_.emplace(*solver_, *arena_);
    (void)arena_->seal(false);
    node_of_.reserve(2 * nodes_wanted_);
    outcome_.steps.reserve(order_.size() + options.idle_steps + 1);
    edge_of_.assign(limits.max_factors, -1);
  }

  SolveOutcome run() {
    if (options_.batch) {
      batch();
    } else {
      incremental();
    }
    finish();
    return std::move(outcome_);
  }

 private:
  struct Item {
    std::uint64_t moment;
    std::uint64_t newest;
    int edge;
  };

  /// Which edges make sense, and in which order they come.
  void prepare() {
    std::unordered_map<std::uint64_t, int> seen;
    for (int i = 0; i < static_cast<int>(file_.edges.size()); ++i) {
      const Edge& e = file_.edges[i];
      const typename Space::Block info = to_block(e.information, Space{});
      if (e.a == e.b || Eigen::LLT<typename Space::Block>{info}.info() != Eigen::Success) {
        ++outcome_.bad_edges;
        continue;
      }
      for (const auto id : {e.a, e.b}) seen.try_emplace(id, 0);
      const bool a_later = std::pair{moment(e.a), e.a} > std::pair{moment(e.b), e.b};
      const std::uint64_t newest = a_later ? e.a : e.b;
      order_.push_back({moment(newest), newest, i});
    }
    nodes_wanted_ = seen.size();
    const auto distance = [&](const Item& item) {  // odometry first within a step
      const Edge& e = file_.edges[item.edge];
      return e.a > e.b ? e.a - e.b : e.b - e.a;
    };
    std::stable_sort(order_.begin(), order_.end(), [&](const Item& x, const Item& y) {
      if (x.moment != y.moment) return x.moment < y.moment;
      if (x.newest != y.newest) return x.newest < y.newest;
      return distance(x) < distance(y);
    });
    for (const Vertex& v : file_.vertices) start_.try_emplace(v.id, v.pose);
  }

  /// Room for the old factor and the new one, with some fill to spare.
  [[nodiscard]] int blocks_wanted() const {
    std::unordered_map<std::uint64_t, int> index;
    std::vector<std::pair<int, int>> pairs;
    const auto of = [&](std::uint64_t id) {
      return index.try_emplace(id, static_cast<int>(index.size())).first->second;
    };
    for (const Item& item : order_)
      pairs.emplace_back(of(file_.edges[item.edge].a), of(file_.edges[item.edge].b));
    const int fill = factor_blocks(static_cast<int>(index.size()), pairs);
    return 2 * fill + fill / 4 + 1024;
  }

  int node(std::uint64_t id) {
    const auto found = node_of_.find(id);
    if (found != node_of_.end()) return found->second;
    typename Space::Pose pose{};
    if (options_.batch) {
      if (const auto s = start_.find(id); s != start_.end()) pose = to_pose(s->second, Space{});
    }
    const int n = solver_->add_node(pose, {0, id});
    node_of_.emplace(id, n);
    return n;
  }

  void add(int edge) {
    const Edge& e = file_.edges[edge];
    const int a = node(e.a);
    const int b = node(e.b);
    const bool doubted = judge_ && closure(e);
    const int f = solver_->add_between(a, b, to_pose(e.z, Space{}),
                                       to_block(e.information, Space{}), doubted ? 0.0 : 1.0);
    edge_of_[f] = edge;
    if (!doubted) return;
    solver_->flush();
    judge_->consider(f);
  }

  /// Odometry follows its agent's poses one by one and is trusted; all else is a closure.
  [[nodiscard]] static bool closure(const Edge& e) {
    return e.a > e.b ? e.a - e.b != 1 : e.b - e.a != 1;
  }

  /// After the last pose: verdicts over the whole set, each round at a settled estimate.
  void review() {
    for (int round = 0; judge_ && round < kMostReviews; ++round) {
      bool changed = false;
      timed([&] {
        changed = judge_->review();
        return solver_->update(Deadline::never());
      });
      if (!changed) break;
      for (int k = 0; k < kMostIdleSteps && !solver_->settled(); ++k)
        timed([&] { return solver_->update(Deadline::never()); });
    }
  }

  void batch() {
    for (const Item& item : order_) add(item.edge);
    if (!file_.vertices.empty()) {  // the file's own start, where it has one
      for (const auto& [id, pose] : start_)
        if (const auto n = node_of_.find(id); n != node_of_.end())
          solver_->graph().node(n->second).pose = to_pose(pose, Space{});
    }
    timed([&] { return solver_->optimise(Deadline::never(), 200); });
  }

  void incremental() {
    const Deadline never = Deadline::never();
    const auto deadline = [&] {
      if (!options_.budget_us) return never;
      return Deadline{cpu_, Duration{static_cast<std::int64_t>(*options_.budget_us * 1e3)}};
    };
    for (std::size_t i = 0; i < order_.size();) {
      const std::uint64_t newest = order_[i].newest;
      const std::size_t first = i;
      for (; i < order_.size() && order_[i].newest == newest; ++i)
        for (const auto id : {file_.edges[order_[i].edge].a, file_.edges[order_[i].edge].b})
          (void)node(id);
      timed([&] {
        const Deadline end = deadline();
        for (std::size_t k = first; k < i; ++k) add(order_[k].edge);
        const SolveReport report = solver_->update(end);
        if (judge_) judge_->look_again(kLooksPerStep);
        return report;
      });
    }
    // After the last pose: as many steps as were asked for; else, with no budget, until it settles.
    const bool to_the_end = !options_.budget_us && options_.idle_steps == 0;
    const int idle = to_the_end ? kMostIdleSteps : options_.idle_steps;
    for (int k = 0; k < idle && !(to_the_end && solver_->settled()); ++k)
      timed([&] { return solver_->update(deadline()); });
    if (to_the_end) review();
  }

  template <class Step>
  void timed(Step&& step) {
    using Wall = std::chrono::steady_clock;
    const std::uint64_t heap = heap_allocations();
    const auto wall = Wall::now();
    const Instant cpu = cpu_.now();
    StepTrace trace;
    const SolveReport report = step();
    trace.iterations = report.iterations;
    trace.chi2 = report.chi2;
    trace.cpu_us = seconds(cpu_.now() - cpu) * 1e6;
    trace.wall_us = std::chrono::duration<double, std::micro>(Wall::now() - wall).count();
    outcome_.heap_allocations += heap_allocations() - heap;
    trace.nodes = solver_->graph().node_count();
    trace.factors = solver_->graph().factor_count();
    trace.affected = static_cast<int>(solver_->elimination().affected().size());
    outcome_.steps.push_back(trace);
  }

  void finish() {
    (void)solver_->chi2();
    const Graph<Space>& graph = solver_->graph();
    for (int i = 0; i < graph.factor_end(); ++i) {
      const Factor<Space>& f = graph.factor(i);
      if (!f.state.active || f.weight < 0.5) {
        outcome_.rejected.push_back(file_.edges[edge_of_[i]]);
        continue;
      }
      ++outcome_.accepted;
      outcome_.chi2 += chi2_g2o(f);
      outcome_.f_log += 0.5 * f.chi2;
    }
    for (const StepTrace& s : outcome_.steps) outcome_.total_ms += s.cpu_us * 1e-3;
    outcome_.arena_bytes = arena_->used_bytes();
    outcome_.damped_pivots = solver_->elimination().damped_pivots();
    outcome_.overflows = solver_->overflows();
    outcome_.live_blocks = solver_->elimination().pool().live();
    const std::map<std::uint64_t, int> sorted{node_of_.begin(), node_of_.end()};
    for (const auto& [id, n] : sorted) {
      outcome_.solution.vertices.push_back({id, from_pose(graph.node(n).pose)});
      outcome_.groups += graph.node(n).group == n ? 1 : 0;
    }
    outcome_.solution.planar = file_.planar;
    outcome_.solution.edges = file_.edges;
  }

  const GraphFile& file_;
  const SolveOptions& options_;
  ThreadCpuClock cpu_;
  std::vector<Item> order_;
  std::size_t nodes_wanted_ = 0;
  std::unordered_map<std::uint64_t, Se3> start_;
  std::unordered_map<std::uint64_t, int> node_of_;
  std::vector<int> edge_of_;
  std::optional<Arena> arena_;
  std::optional<PoseGraph<Space>> solver_;
  std::optional<ClosureJudge<Space>> judge_;
  SolveOutcome outcome_;
};

}  // namespace

SolveOutcome solve(const GraphFile& graph, const SolveOptions& options) {
  if (graph.planar) return Run<PlanarSpace>{graph, options}.run();
  return Run<SpatialSpace>{graph, options}.run();
}

}  // namespace maplet::graphs
