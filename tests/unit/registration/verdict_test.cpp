// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/registration/verdict.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <memory>

#include "core/registration/closure_finder.hpp"
#include "tests/support/maplets.hpp"

namespace maplet {
namespace {

using Guess = Transform<MapletA, MapletB>;

std::unique_ptr<Maplet> view(const std::vector<test::Wall>& walls, const Se3& T_world_maplet,
                             std::uint32_t id = 0) {
  auto m = std::make_unique<Maplet>();
  test::fill(*m, walls, T_world_maplet);
  m->key.id = id;
  return m;
}

Closure verify(const Maplet& a, const Maplet& b, const Se3& guess) {
  const auto verifier = std::make_unique<Verifier>(RegistrationConfig{});
  return verifier->verify(a, b, Guess{guess}, 0.4, 0.2, Prior::kGuess, Deadline::never());
}

TEST(Verifier, AcceptsTheSamePlace) {
  const Se3 T_world_a = test::camera_at({2.0, 2.5, 1.2}, 0.2);
  const Se3 T_world_b = test::camera_at({2.8, 2.2, 1.25}, 0.7);
  const Closure c = verify(*view(test::room(), T_world_a), *view(test::room(), T_world_b),
                           T_world_a.inverse() * T_world_b);
  EXPECT_EQ(c.judgement.verdict, Verdict::kAccept) << c.judgement.reason;
}

TEST(Verifier, EmptyAndPoorMapletsAreNotAccepted) {
  const Se3 T = test::camera_at({2.0, 2.5, 1.2}, 0.2);
  const auto room = view(test::room(), T);
  EXPECT_EQ(verify(*room, *view({}, T), {}).judgement.verdict, Verdict::kReject);
  const std::vector<test::Wall> one{test::room()[2]};
  EXPECT_NE(verify(*view(one, T), *view(one, T), {}).judgement.verdict, Verdict::kAccept);
  const std::vector<test::Wall> parallel{test::room()[0], test::room()[1], test::room()[7]};
  EXPECT_NE(verify(*view(parallel, T), *view(parallel, T), {}).judgement.verdict, Verdict::kAccept);
}

// Of one kind, at one distance.
std::vector<test::Wall> pillars() {
  using V = Eigen::Vector3d;
  std::vector<test::Wall> walls{{V{6, 2.5, 0}, V{6, 0, 0}, V{0, 2.5, 0}},
                                {V{6, 0, 1.3}, V{0, 0, 1.3}, V{6, 0, 0}},
                                {V{6, 5, 1.3}, V{6, 0, 0}, V{0, 0, 1.3}}};
  for (int i = 0; i < 24; ++i) {
    walls.push_back({V{0.4 * i + 1.0, 0.2, 1.3}, V{0, 0.2, 0}, V{0, 0, 1.3}});
  }
  return walls;
}

// Shifted by one they fit nearly as well.
TEST(Verifier, RepeatedStructureIsUndecided) {
  const auto walls = pillars();
  const Se3 T = test::camera_at({3.0, 2.5, 1.2}, 0.0);
  const Closure c = verify(*view(walls, T), *view(walls, T), {});
  EXPECT_EQ(c.judgement.verdict, Verdict::kUndecided);
  EXPECT_EQ(c.judgement.reason, "another place fits nearly as well");
}

// Pillars again, and what stands between some of them: the guess is the next pillar's.
TEST(Verifier, AnAnswerBesideItIsTakenWhenMoreSpeaksForIt) {
  auto walls = pillars();
  for (const double x : {1.6, 3.1, 3.4, 5.3}) {
    walls.push_back({{x, 0.7, 0.4}, {0.12, 0, 0}, {0, 0, 0.4}});
    walls.push_back({{x + 0.12, 0.5, 0.4}, {0, 0.2, 0}, {0, 0, 0.4}});
  }
  const Se3 T_world_a = test::camera_at({3.0, 2.5, 1.2}, 0.0);
  const Se3 T_world_b = test::camera_at({3.0, 2.4, 1.25}, 0.0);
  const auto a = view(walls, T_world_a);
  const auto b = view(walls, T_world_b);
  const Se3 truth = T_world_a.inverse() * T_world_b;
  const Se3 world_x{Eigen::Quaterniond::Identity(), {0.4, 0, 0}};
  const Se3 guess = T_world_a.inverse() * (world_x * T_world_b);
  const auto verifier = std::make_unique<Verifier>(RegistrationConfig{});
  const auto off = [&](const Closure& c) {
    return (truth.inverse() * c.alignment.T_a_b.se3).t.norm();
  };
  Closure c = verifier->align(*a, *b, Guess{guess}, 0.19, 0.14, Deadline::never());
  ASSERT_TRUE(c.aligned);
  EXPECT_NEAR(off(c), 0.4, 0.05);
  verifier->judge(*a, *b, c, 0.6, 0.2, Prior::kGuess, Deadline::never());
  EXPECT_LT(off(c), 0.02);
}

// Two walls and no more: along them and up it stays where it was guessed, however far one looks.
TEST(Verifier, NothingMovesAlongAFreeAxis) {
  const Se3 T = test::camera_at({2.0, 2.5, 1.2}, 0.2);
  const std::vector<test::Wall> parallel{test::room()[0], test::room()[1]};
  const Vector6d off = (Vector6d() << 0.1, 0.1, 0.1, 0, 0, 0).finished();
  const Closure c = verify(*view(parallel, T), *view(parallel, T), Se3::exp(off));
  ASSERT_TRUE(c.aligned);
  EXPECT_FALSE(c.alignment.free_axes.empty());
  EXPECT_LT(c.alignment.T_a_b.se3.t.norm(), 0.2);
}

// Along it they may lie elsewhere.
TEST(Verdict, WhatIsLookedThroughRejectsWhereNoAxisIsFree) {
  MapletAlignment found;
  found.matches = 10;
  found.overlap = 0.5;
  Evidence evidence;
  evidence.agreed = evidence.contradicted = 1.0;
  const auto verdict = [&] {
    return judge_alignment(found, evidence, Prior::kGuess, RegistrationConfig{}).verdict;
  };
  EXPECT_EQ(verdict(), Verdict::kReject);
  found.free_axes.push_back(Vector6d::Unit(0));
  EXPECT_EQ(verdict(), Verdict::kUndecided);
}

// One looked through where the other has a wall: across the room, facing the camera.
TEST(Evidence, WallInTheWayIsNoticed) {
  const Se3 T = test::camera_at({1.0, 2.5, 1.2}, 0.0);
  const auto room = view(test::room(), T);
  auto walls = test::room();
  walls.push_back({{3.0, 2.5, 1.3}, {0, 0, 1.3}, {0, 2.5, 0}});
  const Evidence same = weigh_evidence(*room, *room, {}, Deadline::never());
  EXPECT_EQ(same.contradicted, 0.0);
  EXPECT_GT(same.agreed, 1.0);
  const Evidence other = weigh_evidence(*room, *view(walls, T), {}, Deadline::never());
  EXPECT_GT(other.contradicted, 0.1);  // a ninth of it is in the one camera's view
}

MapletAlignment good_alignment() {
  MapletAlignment found;
  found.matches = 20;
  found.overlap = 0.5;
  found.chi2_per_dof = 0.5;
  found.covariance = 1e-4 * Matrix6d::Identity();
  return found;
}

TEST(Judgement, WithoutAPriorItMustBeKnownClosely) {
  const RegistrationConfig config;
  Evidence evidence;
  evidence.agreed = 10.0;
  evidence.small_agreed = 5.0;
  const auto verdict = [&](const MapletAlignment& found, Prior prior) {
    return judge_alignment(found, evidence, prior, config).verdict;
  };
  MapletAlignment found = good_alignment();
  EXPECT_EQ(verdict(found, Prior::kNone), Verdict::kAccept);
  found.covariance(0, 0) = 0.12 * 0.12;
  EXPECT_EQ(verdict(found, Prior::kNone), Verdict::kUndecided);
  EXPECT_EQ(verdict(found, Prior::kPath), Verdict::kAccept);
  found = good_alignment();
  found.covariance(4, 4) = 0.04 * 0.04;
  EXPECT_EQ(verdict(found, Prior::kNone), Verdict::kUndecided);
  found = good_alignment();
  found.covariance(1, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(verdict(found, Prior::kNone), Verdict::kUndecided);
  found = good_alignment();
  found.covariance = 5e-5 * Matrix6d::Identity();
  found.chi2_per_dof = 1.0;
  EXPECT_EQ(verdict(found, Prior::kNone), Verdict::kAccept);
  found.spread = 0.1;  // most planes agree, some do not
  EXPECT_EQ(verdict(found, Prior::kNone), Verdict::kUndecided);
  EXPECT_EQ(verdict(found, Prior::kGuess), Verdict::kAccept);
  found = good_alignment();
  found.overlap = 0.25;
  EXPECT_EQ(verdict(found, Prior::kNone), Verdict::kAccept);
  found.overlap = 0.15;
  EXPECT_EQ(verdict(found, Prior::kNone), Verdict::kUndecided);
  EXPECT_EQ(verdict(found, Prior::kGuess), Verdict::kUndecided);
}

// What fits exactly leaves no doubt; a wall that stands elsewhere in the other maplet does.
TEST(Icap, APairThatDisagreesRaisesDoubt) {
  const Se3 T = test::camera_at({2.0, 2.5, 1.2}, 0.2);
  auto moved = test::room();
  moved[2].centre.x() += 0.05;
  moved[2].centre.y() += 0.05;
  double doubt[2];
  for (const bool differs : {false, true}) {
    const auto icap = std::make_unique<Icap>(RegistrationConfig{});
    const auto a = view(test::room(), T);  // the pairs point into both
    const auto b = view(differs ? moved : test::room(), T);
    auto found = icap->align(*a, *b, {}, Deadline::never());
    ASSERT_TRUE(found);
    const double before = found->covariance.trace();
    icap->doubt(*found);
    doubt[differs ? 1 : 0] = (found->covariance.trace() - before) / before;
  }
  EXPECT_LT(doubt[0], 0.01);
  EXPECT_GT(doubt[1], 2.0 * doubt[0] + 1e-3);
}

class TwoPlaces final : public PlacePrior {
 public:
  TwoPlaces(const Maplet& older, const Se3& T_older_newest) : older_{older}, T_{T_older_newest} {}
  [[nodiscard]] int count() const noexcept override { return 1; }
  [[nodiscard]] MapletKey key(int) const noexcept override { return older_.key; }
  [[nodiscard]] bool relate(int, const MapletKey&, Guess& T) const noexcept override {
    T = Guess{T_};
    return true;
  }
  [[nodiscard]] const Maplet* load(int) noexcept override { return &older_; }

 private:
  const Maplet& older_;
  Se3 T_;
};

TEST(ClosureFinder, ClosesALoopThatDrifted) {
  const Se3 T_world_a = test::camera_at({2.0, 2.5, 1.2}, 0.2);
  const Se3 T_world_b = test::camera_at({2.8, 2.2, 1.25}, 0.7);
  const auto a = view(test::room(), T_world_a, 3);
  const Se3 T_a_b = T_world_a.inverse() * T_world_b;
  const Se3 drift = Se3::exp((Vector6d() << 0.15, 0.05, -0.1, 0.02, 0.05, 0.0).finished());
  Arena arena;
  ClosureFinder finder{{}, arena};
  TwoPlaces places{*a, T_a_b * drift};
  const auto found = finder.run(*view(test::room(), T_world_b, 12), places, Deadline::never());
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].kind, DeltaPose::Kind::kClosure);
  EXPECT_EQ(found[0].a.id, 3U);
  EXPECT_LT((T_a_b.inverse() * found[0].T_a_b.se3).log().norm(), 1e-3);
  // Neighbours on the path are the registrar's.
  EXPECT_TRUE(finder.run(*view(test::room(), T_world_b, 5), places, Deadline::never()).empty());
  EXPECT_EQ(finder.counts().tried, 1U);
}

}  // namespace
}  // namespace maplet
