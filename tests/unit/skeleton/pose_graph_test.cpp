// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/skeleton/pose_graph.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "core/skeleton/linearise.hpp"
#include "tests/unit/skeleton/graphs.hpp"
#include "tools/solve/heap_count.hpp"

namespace maplet {
namespace {

using test::kRoom;

template <class Space>
class PoseGraphTest : public testing::Test {
 protected:
  using Pose = typename Space::Pose;

  static void feed(PoseGraph<Space>& graph, const test::RandomGraph<Space>& random,
                   bool update_each_step) {
    int nodes = 0;
    for (const auto& m : random.measurements) {
      while (nodes <= std::max(m.a, m.b)) {
        graph.add_node(Pose{}, {0, static_cast<std::uint64_t>(nodes++)});
      }
      graph.add_between(m.a, m.b, m.z, m.information);
      if (update_each_step) graph.update(Deadline::never());
    }
  }
};

using Spaces = testing::Types<PlanarSpace, SpatialSpace>;
TYPED_TEST_SUITE(PoseGraphTest, Spaces);

TYPED_TEST(PoseGraphTest, ChainIsComposedExactly) {
  using Space = TypeParam;
  Arena arena;
  PoseGraph<Space> graph{kRoom, arena};
  typename Space::Tangent step = Space::Tangent::Constant(0.1);
  const auto z = Space::retract({}, step);
  auto expected = typename Space::Pose{};
  graph.add_node({}, {0, 0});
  for (int i = 1; i < 30; ++i) {
    graph.add_node({}, {0, static_cast<std::uint64_t>(i)});
    graph.add_between(i - 1, i, z, Space::Block::Identity());
    EXPECT_EQ(graph.update(Deadline::never()).stop, Stop::kConverged);
    expected = Space::compose(expected, z);
    EXPECT_LT(Space::error(graph.graph().node(i).pose, expected).norm(), 1e-9);
  }
  EXPECT_LT(graph.chi2(), 1e-12);
}

TYPED_TEST(PoseGraphTest, TwoMeasurementsOfOnePairMeetAtTheirWeightedMean) {
  using Space = TypeParam;
  Arena arena;
  PoseGraph<Space> graph{kRoom, arena};
  graph.add_node({}, {0, 0});
  graph.add_node({}, {0, 1});
  typename Space::Tangent one = Space::Tangent::Zero();
  typename Space::Tangent two = Space::Tangent::Zero();
  one[0] = 1.0;
  two[0] = 2.0;
  graph.add_between(0, 1, Space::retract({}, one), Space::Block::Identity());
  graph.add_between(0, 1, Space::retract({}, two), 3.0 * Space::Block::Identity());
  graph.update(Deadline::never());
  const auto mean = Space::error({}, graph.graph().node(1).pose);
  EXPECT_NEAR(mean[0], 1.75, 1e-9);
  EXPECT_NEAR(graph.chi2(), 0.75 * 0.75 + 3.0 * 0.25 * 0.25, 1e-9);
}

// The elimination's columns must multiply out to the Hessian (eq. 8).
TYPED_TEST(PoseGraphTest, StepEqualsThatOfADenseSolver) {
  using Space = TypeParam;
  constexpr int kDim = Space::kDim;
  const test::RandomGraph<Space> random{20, 0.02, 3};
  Arena arena;
  PoseGraph<Space> graph{kRoom, arena};
  TestFixture::feed(graph, random, true);
  const auto& g = graph.graph();
  const Eigen::MatrixXd h = test::dense_hessian(g);
  const auto n = h.rows();
  Eigen::MatrixXd product = Eigen::MatrixXd::Zero(n, n);
  const auto& pool = graph.elimination().pool();
  for (int j = 0; j < g.node_end(); ++j) {
    for (int s = pool.start(j); s < pool.start(j) + pool.length(j); ++s)
      for (int t = pool.start(j); t < pool.start(j) + pool.length(j); ++t)
        product.block<kDim, kDim>(kDim * pool.slot(s).row, kDim * pool.slot(t).row) +=
            Eigen::Map<const typename Space::Block>{pool.block(s)} *
            Eigen::Map<const typename Space::Block>{pool.block(t)}.transpose();
  }
  EXPECT_LT((product - h).norm(), 1e-9 * h.norm());
}

TYPED_TEST(PoseGraphTest, IncrementalAndBatchMeetAtTheSameOptimum) {
  using Space = TypeParam;
  for (const unsigned seed : {1u, 2u, 3u}) {
    const test::RandomGraph<Space> random{200, 0.02, seed};
    Arena arena;
    PoseGraph<Space> incremental{kRoom, arena};
    PoseGraph<Space> batch{kRoom, arena};
    TestFixture::feed(incremental, random, true);
    TestFixture::feed(batch, random, false);
    EXPECT_EQ(batch.optimise(Deadline::never()).stop, Stop::kConverged);
    const double best = batch.chi2();
    EXPECT_GT(best, 1.0);
    EXPECT_LT(incremental.chi2(), 1.05 * best);  // within the policy's shares at any time
    for (int k = 0; k < 500 && !incremental.settled(); ++k) incremental.update(Deadline::never());
    EXPECT_TRUE(incremental.settled());
    EXPECT_NEAR(incremental.chi2(), best, 1e-6 * best);
    incremental.optimise(Deadline::never());
    for (int i = 0; i < 200; ++i)
      EXPECT_LT(Space::error(batch.graph().node(i).pose, incremental.graph().node(i).pose).norm(),
                1e-5);
  }
}

TYPED_TEST(PoseGraphTest, GroupsStandApartUntilAFactorJoinsThem) {
  using Space = TypeParam;
  const test::RandomGraph<Space> random{40, 0.01, 5};
  Arena arena;
  PoseGraph<Space> graph{kRoom, arena};
  for (std::uint64_t i = 0; i < 40; ++i) graph.add_node({}, {0, i});
  for (const auto& m : random.measurements) {
    if ((m.a < 20) != (m.b < 20)) continue;
    graph.add_between(m.a, m.b, m.z, m.information);
    graph.update(Deadline::never());
  }
  EXPECT_NE(graph.group(0), graph.group(25));
  for (const auto& m : random.measurements) {
    if ((m.a < 20) == (m.b < 20)) continue;
    graph.add_between(m.a, m.b, m.z, m.information);
    graph.update(Deadline::never());
  }
  EXPECT_EQ(graph.group(0), graph.group(25));
  PoseGraph<Space> batch{kRoom, arena};
  TestFixture::feed(batch, random, false);
  batch.optimise(Deadline::never());
  EXPECT_NEAR(graph.chi2(), batch.chi2(), 1e-3 * batch.chi2());
}

TYPED_TEST(PoseGraphTest, AWeightOfZeroTakesAFactorOut) {
  using Space = TypeParam;
  const test::RandomGraph<Space> random{60, 0.01, 9};
  Arena arena;
  PoseGraph<Space> with{kRoom, arena};
  PoseGraph<Space> without{kRoom, arena};
  TestFixture::feed(with, random, true);
  TestFixture::feed(without, random, true);
  const double clean = without.chi2();
  typename Space::Tangent wrong = Space::Tangent::Constant(1.0);
  const int f = with.add_between(10, 50, Space::retract({}, wrong), Space::Block::Identity() * 1e4);
  with.update(Deadline::never());
  EXPECT_GT(with.chi2(), 2.0 * clean);
  with.set_weight(f, 0.0);
  with.update(Deadline::never());
  EXPECT_NEAR(with.chi2(), clean, 1e-3 * clean);
}

TYPED_TEST(PoseGraphTest, CarriesOverWhatTheDeadlineCutOff) {
  using Space = TypeParam;
  const test::RandomGraph<Space> random{150, 0.02, 4};
  Arena arena;
  PoseGraph<Space> graph{kRoom, arena};
  TestFixture::feed(graph, random, false);
  // A clock that advances at each look.
  class Ticking final : public Clock {
   public:
    Instant now() const noexcept override { return Instant{Duration{++ticks}}; }
    mutable std::int64_t ticks = 0;
  } clock;
  int calls = 0;
  while (graph.update(Deadline{clock, Duration{3}}).stop == Stop::kDeadline)
    ASSERT_LT(++calls, 2000);
  EXPECT_GT(calls, 3);
  PoseGraph<Space> batch{kRoom, arena};
  TestFixture::feed(batch, random, false);
  batch.optimise(Deadline::never());
  EXPECT_NEAR(graph.chi2(), batch.chi2(), 1e-3 * batch.chi2());
}

// Updates so small that what is looked at here happens at most once in each.
TYPED_TEST(PoseGraphTest, LinearisesEverythingAnewOnlyAfterAStep) {
  using Space = TypeParam;
  int times = 0;
  for (unsigned seed = 1; seed <= 6; ++seed) {
    const test::RandomGraph<Space> random{200, 0.1, seed};
    Arena arena;
    PoseGraph<Space> graph{kRoom, arena, {.work_per_update = 500}};
    TestFixture::feed(graph, random, true);
    const auto oldest_column = [&] {
      std::int64_t rank = graph.elimination().rank(0);
      for (int i = 1; i < 200; ++i) rank = std::min(rank, graph.elimination().rank(i));
      return rank;
    };
    std::int64_t oldest = oldest_column();
    bool stepped = true;
    for (int k = 0; k < 20'000 && !graph.settled(); ++k) {
      stepped = graph.update(Deadline::never()).iterations > 0 || stepped;
      if (oldest_column() == oldest) continue;
      oldest = oldest_column();
      EXPECT_TRUE(stepped) << "seed " << seed << ", update " << k;
      stepped = false;
      ++times;
    }
    EXPECT_TRUE(graph.settled());
  }
  EXPECT_GT(times, 10);
}

TYPED_TEST(PoseGraphTest, SetsFactorsAsideWhenTheBlocksAreUsedUp) {
  using Space = TypeParam;
  const test::RandomGraph<Space> random{200, 0.02, 6};
  Arena arena;
  PoseGraph<Space> graph{{400, 1200, 700}, arena};
  TestFixture::feed(graph, random, true);
  EXPECT_GT(graph.overflows(), 0u);
  EXPECT_LT(graph.overflows(), 100u);
  for (int i = 0; i < 200; ++i) EXPECT_TRUE(Space::finite(graph.graph().node(i).pose));
  EXPECT_TRUE(std::isfinite(graph.chi2()));
}

TYPED_TEST(PoseGraphTest, NeverAllocatesAfterConstruction) {
  using Space = TypeParam;
#ifdef MAPLET_SANITIZED
  GTEST_SKIP() << "SKIPPED: sanitizers have their own malloc";
#endif
  const test::RandomGraph<Space> random{100, 0.02, 8};
  Arena arena;
  PoseGraph<Space> graph{kRoom, arena};
  const auto before = graphs::heap_allocations();
  TestFixture::feed(graph, random, true);
  graph.optimise(Deadline::never());
  EXPECT_EQ(graphs::heap_allocations(), before);
  EXPECT_FALSE(std::vector<int>(100, 1).empty());
  int* volatile one = new int{1};
  delete one;
  EXPECT_GT(graphs::heap_allocations(), before);  // the counter counts
}

}  // namespace
}  // namespace maplet
