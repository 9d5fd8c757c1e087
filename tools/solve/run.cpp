// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/solve/run.hpp"

#include <time.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <unordered_map>
#include <utility>

#include "core/skeleton/frame_finder.hpp"
#include "core/skeleton/linearise.hpp"
#include "core/skeleton/pose_graph.hpp"
#include "tools/solve/closures.hpp"
#include "tools/solve/convert.hpp"
#include "tools/solve/fill.hpp"
#include "tools/solve/heap_count.hpp"
#include "tools/solve/node_table.hpp"
#include "tools/solve/order.hpp"
#include "tools/solve/outcome.hpp"
#include "tools/solve/roomy_arena.hpp"

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

template <class Space>
class Run {
  static constexpr int kPatience = 1000;      ///< idle updates
  static constexpr int kLeastPatience = 100;  ///< of all reviews together, and one more for
  static constexpr int kEdgesPerUpdate = 10;  ///< so many edges
  static constexpr int kMostIterations = 30;  ///< where patience has ended
  static constexpr int kLastRounds = 3;
  static constexpr int kMostReviews = 30;
  static constexpr int kMostSearches = 10'000;
  static constexpr std::size_t kStepsPerDecision = 20;
  static constexpr int kMostRounds = 40;  ///< of a second start; with closures to be judged fewer
  static constexpr int kFewRounds = 6;
  static constexpr int kLooks = 50;  ///< updates between looks at a second start
  static constexpr std::int64_t kWorkInTime = 240'000;
  static constexpr double kShareWhenFull = 0.05;
  static constexpr double kStepShare = 3e-3;
  static constexpr double kSame = 1e-6;        ///< of chi2: the same end
  static constexpr double kWorthwhile = 1e-3;  ///< of chi2: it is still on its way

 public:
  Run(const GraphFile& file, const SolveOptions& options) : file_{file}, options_{options} {
    Order order = in_time_order(file);
    order_ = std::move(order.items);
    outcome_.bad_edges = order.bad_edges;
    outcome_.named_bad_edges = std::move(order.named);
    for (const Vertex& v : file.vertices) start_.try_emplace(v.id, v.pose);
    arena_ = roomy_arena(std::uint64_t{1} << 34);
    SolvePolicy policy;
    if (file.planar && !options.robust) policy.step_share = kStepShare;
    // Nodes are taken out as they stand: what waits would be frozen before it has had its say.
    if (options.max_nodes > 0) policy.defer_share = kShareWhenFull;
    // A time that is given is the limit: the work that is the limit without it takes half of 2 ms.
    if (options.budget_us > 0.0) policy.work_per_update = kWorkInTime;
    solver_.emplace(
        limits_for(file, order_, order.nodes, options.max_nodes, options.budget_us > 0.0), *arena_,
        policy);
    table_.emplace(*solver_, order.nodes);
    if (options.max_nodes > 0) table_->limit(*arena_);
    if (options.robust) closures_.emplace(*solver_, file, *arena_);
    const auto sight = [](const Edge& e) { return measure::is_sight(e.kind); };
    if (std::any_of(file.edges.begin(), file.edges.end(), sight))
      finder_.emplace(*solver_, *arena_);
    (void)arena_->seal(false);
    outcome_.steps.reserve(order_.size() + options.idle_steps + 1);
    edge_of_.assign(solver_->graph().max_factors(), -1);
  }

  SolveOutcome run() {
    if (options_.batch) {
      batch();
    } else {
      incremental();
    }
    for (const StepTrace& t : outcome_.steps) outcome_.total_ms += t.cpu_us * 1e-3;
    outcome_.arena_bytes = arena_->used_bytes();
    tell(*solver_, *table_, file_, edge_of_, outcome_);
    return std::move(outcome_);
  }

 private:
  void add_node(std::uint64_t id) {
    if (table_->has(id)) return;
    typename Space::Pose pose{};
    if (options_.batch) {
      if (const auto s = start_.find(id); s != start_.end()) pose = to_pose(s->second, Space{});
    }
    table_->put(id, solver_->add_node(pose, {0, id}));
  }

  /// A second edge from a pose to the next one is a closure, whoever numbered it.
  [[nodiscard]] bool linked(int a, int b) const {
    bool found = false;
    solver_->graph().for_each_incident(
        a, [&](int, int other) { found = found || (other == b && b >= 0); });
    return found;
  }

  [[nodiscard]] bool fits(const Edge& e) const {
    const auto& graph = solver_->graph();
    int nodes = table_->has(e.a) ? 0 : 1;
    if (e.kind != FactorKind::kPrior && e.a != e.b && !table_->has(e.b)) ++nodes;
    return !graph.factors_full() && graph.node_count() + nodes <= graph.max_nodes();
  }

  void add(int edge) {
    const Edge& e = file_.edges[edge];
    if (!fits(e)) {  // all there is holds the graph together, or stays
      ++outcome_.lost_edges;
      return;
    }
    add_node(e.a);
    if (measure::is_sight(e.kind)) return add_sight(e, edge);
    add_node(e.b);
    const auto a = table_->find(e.a);
    const auto b = table_->find(e.b);
    if (!a || !b || (a->node == b->node && e.kind != FactorKind::kPrior)) {
      ++outcome_.lost_edges;  // its poses were taken out
      return;
    }
    Relation<Space> r{measured(e, Space{}), information(e, Space{})};
    if (a->moved || b->moved) {
      r.covariance = r.covariance.inverse().eval();
      if (e.kind != FactorKind::kPrior) r = a->from_node.then(r);
      if (b->moved) r = r.then(b->from_node.inverse());
      r.covariance = r.covariance.inverse().eval();
    }
    if (e.kind == FactorKind::kPrior) {
      edge_of_[solver_->add_prior(a->node, r.T, r.covariance)] = edge;
      return;
    }
    const bool doubted = closures_ && (!is_odometry(e) || linked(a->node, b->node));
    const int f = solver_->add_between(a->node, b->node, r.T, r.covariance, doubted ? 0.0 : 1.0);
    edge_of_[f] = edge;
    if (!closures_) return;
    if (doubted) {
      closures_->add(f, between_agents(e));
    } else {
      const Relation<Space> step{r.T, r.covariance.inverse()};
      if (e.a < e.b) {
        closures_->odometry(a->node, b->node, step);
      } else {
        closures_->odometry(b->node, a->node, step.inverse());
      }
    }
  }

  void add_sight(const Edge& e, int edge) {
    const auto a = table_->find(e.a);
    if (!file_.points.contains(e.b)) {
      add_node(e.b);
    } else if (a && !table_->has(e.b)) {
      table_->put(e.b, tells_position(e.kind) ? solver_->add_point(a->node, position_of(e, Space{}))
                                              : solver_->add_point());
    }
    const auto b = table_->find(e.b);
    if (!a || !b || a->moved || b->moved) {
      ++outcome_.lost_edges;
      return;
    }
    const int f =
        solver_->add_sight(e.kind, a->node, b->node, measured(e, Space{}), information(e, Space{}));
    edge_of_[f] = edge;
    finder_->note(f);
  }

  /// A valley that wrong closures made may have no way down by small steps: then all at once.
  void settle() {
    for (; patience_ > 0 && !solver_->settled(); --patience_)
      timed([&] { return solver_->update(Deadline::never()); });
    if (!solver_->settled())
      timed([&] { return solver_->optimise(Deadline::never(), kMostIterations); });
  }

  /// Where the fit does not say that this is the best valley: once more from the measurements
  /// alone, as long as that may end lower.
  void second_start() {
    Graph<Space>& graph = solver_->graph();
    const double before = solver_->chi2();
    if (table_->limited() || finder_ || solver_->fits()) return;
    std::vector<typename Space::Pose> poses;
    for (int i = 0; i < graph.node_end(); ++i) poses.push_back(graph.node(i).pose);
    Stop stop = Stop::kDeadline;
    while (stop == Stop::kDeadline)
      timed([&] {
        stop = solver_->start_anew(Deadline::never());
        return SolveReport{};
      });
    double last = stop == Stop::kConverged ? solver_->chi2() : before;
    const int most = closures_ ? kFewRounds : kMostRounds;
    int rounds = 0;
    for (bool promising = stop == Stop::kConverged;
         promising && !solver_->settled() && rounds < most; ++rounds) {
      for (int k = 0; k < kLooks && !solver_->settled(); ++k)
        timed([&] { return solver_->update(Deadline::never()); });
      const double now = solver_->last_chi2();
      promising = now < (1.0 - kSame) * before || now < (1.0 - kWorthwhile) * last;
      last = now;
    }
    if (stop == Stop::kConverged && last < (1.0 - kSame) * before) return settle();
    for (int i = 0; i < graph.node_end(); ++i) graph.node(i).pose = poses[i];
    (void)solver_->chi2();
  }

  template <class Settle>
  void decide_all(Settle&& settle_now) {
    timed([&] {
      closures_->decide(true);
      return solver_->update(Deadline::never());
    });
    settle_now();
  }

  /// Verdicts over the whole set, each round at a settled estimate. @return whether any changed
  template <class Settle>
  bool review(Settle&& settle_now) {
    patience_ = kLeastPatience + static_cast<int>(order_.size() / kEdgesPerUpdate);
    bool changed = true;
    bool ever = false;
    for (int round = 0; round < kMostReviews && changed && patience_ > 0; ++round) {
      timed([&] {
        changed = closures_->review();
        return solver_->update(Deadline::never());
      });
      ever = ever || changed;
      if (changed) settle_now();
    }
    settle_now();  // others may have been taken in beside the one that was asked about
    for (int round = 0; round < kLastRounds && changed && closures_->drop_misfits(); ++round)
      settle_now();
    if (!closures_->choose_sets()) return ever;
    timed([&] { return solver_->update(Deadline::never()); });
    settle_now();
    return true;
  }

  /// All at once. What sights start from, and what is left of a graph that is kept small, are found
  /// on the way: pose by pose first.
  void batch() {
    const auto whole = [&] { timed([&] { return solver_->optimise(Deadline::never(), 200); }); };
    if (finder_ || table_->limited()) {
      incremental();
      return whole();
    }
    for (const Item& item : order_) {
      for (const auto id : {file_.edges[item.edge].a, file_.edges[item.edge].b})
        (void)table_->expect(id);
      add(item.edge);
    }
    taken_ = order_.size();
    for (const auto& [id, pose] : start_)  // the file's own start, where it has one
      if (table_->has(id))
        solver_->graph().node(table_->find(id)->node).pose = to_pose(pose, Space{});
    whole();
    if (!closures_) return;
    decide_all(whole);
    (void)review(whole);
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
      int coming = 0;
      for (; i < order_.size() && order_[i].newest == newest; ++i)
        for (const auto id : {file_.edges[order_[i].edge].a, file_.edges[order_[i].edge].b})
          coming += table_->expect(id) ? 1 : 0;
      taken_ = i;
      timed([&] {
        const Deadline end = deadline();
        table_->make_room(
            coming, std::min(static_cast<int>(i - first), solver_->graph().max_factors() / 4),
            [&](int node) {
              if (closures_) closures_->forget_node(node);
            },
            [&](int f) { forget(f); });
        for (std::size_t k = first; k < i; ++k) add(order_[k].edge);
        if (finder_) finder_->work(end);
        const SolveReport report = solver_->update(end);
        if (closures_) closures_->decide(outcome_.steps.size() % kStepsPerDecision == 0);
        return report;
      });
    }
    for (int k = 0; finder_ && !finder_->idle() && k < kMostSearches; ++k)
      timed([&] {
        finder_->work(deadline());
        return solver_->update(deadline());
      });
    // After the last pose: as many steps as were asked for; else, with no budget, until it settles.
    const bool to_the_end = !options_.budget_us && options_.idle_steps == 0;
    const int idle = to_the_end ? 0 : options_.idle_steps;
    if (to_the_end) settle();
    patience_ = kPatience;
    for (int k = 0; k < idle; ++k) timed([&] { return solver_->update(deadline()); });
    if (!to_the_end) return;
    const auto settle_now = [&] { settle(); };
    if (closures_) decide_all(settle_now);
    second_start();
    if (closures_ && review(settle_now)) second_start();
  }

  void forget(int factor) {
    edge_of_[factor] = -1;
    if (closures_) closures_->forget(factor);
    if (finder_) finder_->forget(factor);
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
    if (!options_.progress) return;
    if (taken_ < order_.size()) {
      options_.progress("edges", taken_, order_.size());
    } else {
      options_.progress("settling, steps", ++settling_, std::nullopt);
    }
  }

  const GraphFile& file_;
  const SolveOptions& options_;
  ThreadCpuClock cpu_;
  std::vector<Item> order_;
  std::size_t taken_ = 0;  ///< of order_
  std::uint64_t settling_ = 0;
  int patience_ = kPatience;  ///< updates left
  std::unordered_map<std::uint64_t, Se3> start_;
  std::vector<int> edge_of_;
  std::unique_ptr<Arena> arena_;
  std::optional<PoseGraph<Space>> solver_;
  std::optional<NodeTable<Space>> table_;
  std::optional<FrameFinder<Space>> finder_;
  std::optional<Closures<Space>> closures_;
  SolveOutcome outcome_;
};

}  // namespace

SolveOutcome solve(const GraphFile& graph, const SolveOptions& options) {
  if (graph.planar) return Run<PlanarSpace>{graph, options}.run();
  return Run<SpatialSpace>{graph, options}.run();
}

}  // namespace maplet::graphs
