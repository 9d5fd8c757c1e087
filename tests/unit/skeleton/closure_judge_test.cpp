// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/skeleton/closure_judge.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "tests/unit/skeleton/graphs.hpp"

namespace maplet {
namespace {

using test::kRoom;

template <class Space>
class ClosureJudgeTest : public testing::Test {
 protected:
  using Tangent = typename Space::Tangent;
  using Block = typename Space::Block;

  /// A street of poses a metre apart, walked up and down again.
  void walk_up_and_down(PoseGraph<Space>& graph) {
    for (std::uint64_t i = 0; i < 40; ++i) graph.add_node({}, {0, i});
    for (int i = 0; i + 1 < 40; ++i) {
      Tangent step = Tangent::Zero();
      step[0] = i < 20 ? 1.0 : -1.0;
      graph.add_between(i, i + 1, Space::retract({}, step), information_);
      graph.flush();
    }
  }
  /// What the truth says about pose i on the way up and 40 - i on the way down.
  static int partner(int i) { return 40 - i; }

  Block information_ = 1e4 * Block::Identity();
  Arena arena_;
};

using Spaces = testing::Types<PlanarSpace, SpatialSpace>;
TYPED_TEST_SUITE(ClosureJudgeTest, Spaces);

TYPED_TEST(ClosureJudgeTest, MarginalsAreThoseOfTheDenseInverse) {
  using Space = TypeParam;
  constexpr int kDim = Space::kDim;
  const test::RandomGraph<Space> random{20, 0.02, 3};
  PoseGraph<Space> graph{kRoom, this->arena_};
  for (std::uint64_t i = 0; i < 20; ++i) graph.add_node({}, {0, i});
  for (const auto& m : random.measurements) {
    graph.add_between(m.a, m.b, m.z, m.information);
    graph.update(Deadline::never());
  }
  graph.flush();
  const auto& g = graph.graph();
  const Eigen::MatrixXd h = test::dense_hessian(g);
  const auto n = h.rows();
  const Eigen::MatrixXd all = h.inverse();
  Marginals<Space> marginals{g, graph.elimination(), this->arena_};
  for (const int i : {0, 5, 19}) {
    const auto one = marginals.of(i);
    EXPECT_LT((one - all.block<kDim, kDim>(kDim * i, kDim * i)).norm(), 1e-6 * all.norm());
  }
  const auto rel = Space::between(g.node(4).pose, g.node(17).pose);
  typename Space::Block by_a, by_b;
  Space::jacobians(rel, rel, Space::Tangent::Zero(), by_a, by_b);
  Eigen::MatrixXd j = Eigen::MatrixXd::Zero(kDim, n);
  j.middleCols<kDim>(kDim * 4) = by_a;
  j.middleCols<kDim>(kDim * 17) = by_b;
  EXPECT_LT((marginals.of(4, 17) - j * all * j.transpose()).norm(), 1e-6 * all.norm());
}

TYPED_TEST(ClosureJudgeTest, BelievesTrueClosuresAndNotFalseOnes) {
  using Space = TypeParam;
  PoseGraph<Space> graph{kRoom, this->arena_};
  ClosureJudge<Space> judge{graph, this->arena_};
  this->walk_up_and_down(graph);
  std::vector<int> right, wrong;
  for (int i = 2; i < 18; ++i) {
    const bool lie = i % 2 == 0;
    const int to = lie ? (this->partner(i) + 7 - 20) % 20 + 20 : this->partner(i);
    const int f = graph.add_between(i, to, {}, this->information_, 0.0);
    graph.flush();
    judge.consider(f);
    (lie && to != this->partner(i) ? wrong : right).push_back(f);
  }
  for (int k = 0; k < 100 && !graph.settled(); ++k) graph.update(Deadline::never());
  while (judge.review())
    for (int k = 0; k < 100 && !graph.settled(); ++k) graph.update(Deadline::never());
  for (const int f : right) EXPECT_EQ(judge.state(f), ClosureState::kAccepted) << f;
  for (const int f : wrong) EXPECT_NE(judge.state(f), ClosureState::kAccepted) << f;
  EXPECT_FALSE(wrong.empty());
  EXPECT_LT(graph.chi2(), 1.0);
}

TYPED_TEST(ClosureJudgeTest, AVerdictByHandIsReversible) {
  using Space = TypeParam;
  PoseGraph<Space> graph{kRoom, this->arena_};
  ClosureJudge<Space> judge{graph, this->arena_};
  this->walk_up_and_down(graph);
  const int f = graph.add_between(3, 30, {}, this->information_, 0.0);
  graph.flush();
  judge.consider(f);
  EXPECT_NE(judge.state(f), ClosureState::kAccepted);
  const auto settle = [&] {
    graph.update(Deadline::never());
    for (int k = 0; k < 100 && !graph.settled(); ++k) graph.update(Deadline::never());
    return graph.chi2();
  };
  EXPECT_LT(settle(), 1e-6);
  judge.force(f, true);
  EXPECT_GT(settle(), 1.0);
  judge.force(f, false);
  EXPECT_LT(settle(), 1e-6);
}

TYPED_TEST(ClosureJudgeTest, TwoAgentsMeetWhenTwoClosuresAgree) {
  using Space = TypeParam;
  PoseGraph<Space> graph{kRoom, this->arena_};
  ClosureJudge<Space> judge{graph, this->arena_};
  for (std::uint64_t i = 0; i < 20; ++i) graph.add_node({}, {i / 10, i});
  typename Space::Tangent step = Space::Tangent::Zero();
  step[0] = 1.0;
  for (int i = 0; i < 19; ++i)
    if (i != 9) graph.add_between(i, i + 1, Space::retract({}, step), this->information_);
  const auto meet = [&](int a, int b, double x) {
    typename Space::Tangent t = Space::Tangent::Zero();
    t[0] = x;
    const int f = graph.add_between(a, b, Space::retract({}, t), this->information_, 0.0);
    graph.flush();
    judge.consider(f);
    return f;
  };
  const int lie = meet(1, 11, 5.0);
  EXPECT_NE(graph.group(1), graph.group(11));
  const int first = meet(2, 12, 0.0);
  EXPECT_NE(graph.group(1), graph.group(11));  // one alone proves nothing
  const int second = meet(6, 16, 0.0);
  EXPECT_EQ(graph.group(1), graph.group(11));
  EXPECT_EQ(judge.state(first), ClosureState::kAccepted);
  EXPECT_EQ(judge.state(second), ClosureState::kAccepted);
  judge.look_again(10);
  EXPECT_NE(judge.state(lie), ClosureState::kAccepted);
}

}  // namespace
}  // namespace maplet
