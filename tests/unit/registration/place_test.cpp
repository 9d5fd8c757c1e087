// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <memory>

#include "core/registration/place_index.hpp"
#include "core/registration/place_verifier.hpp"
#include "core/registration/region.hpp"
#include "core/registration/saliency.hpp"
#include "tests/support/furnished.hpp"

namespace maplet {
namespace {

using V = Eigen::Vector3d;
using test::furnished;
using test::view;

struct NoRelations final : PlaceRelations {
  [[nodiscard]] bool relate(const MapletKey&, const MapletKey&, Se3&) const noexcept override {
    return false;
  }
};

double error_m(const Se3& T, const Se3& truth) { return (truth.inverse() * T).log().norm(); }

TEST(PlaceIndex, FindsThePlaceAmongManyAndTheTransform) {
  Arena arena;
  PlaceIndex index{64, arena};
  for (unsigned seed = 0; seed < 40; ++seed) {
    index.add(*view(furnished(seed), test::camera_at({-1.0, 0.2, 1.2}, 0.1 * seed), 1, seed));
  }
  int first = 0;
  for (unsigned seed = 0; seed < 40; seed += 4) {
    // Turned by more than half a turn, even on its side: no gravity is used.
    const Se3 T_world_b = test::camera_at({0.4, -0.3, 1.0}, 2.5) *
                          Se3::exp((Vector6d() << 0, 0, 0, 0.3, 0, 1.4).finished());
    const auto& found = index.query(*view(furnished(seed), T_world_b, 2, 0), {}, Deadline::never());
    ASSERT_FALSE(found.empty());
    const Se3 T_a_b = test::camera_at({-1.0, 0.2, 1.2}, 0.1 * seed).inverse() * T_world_b;
    first += found[0].key.id == seed && error_m(found[0].guesses[0].T_a_b, T_a_b) < 0.3 ? 1 : 0;
  }
  EXPECT_GE(first, 9);
}

TEST(PlaceIndex, IsBoundedAndSkipsTheAskingMaplet) {
  Arena arena;
  PlaceIndex index{4, arena};
  const Se3 T = test::camera_at({-1.0, 0.2, 1.2}, 0.3);
  for (unsigned seed = 0; seed < 6; ++seed) index.add(*view(furnished(seed), T, 1, seed));
  EXPECT_EQ(index.size(), 4U);
  EXPECT_EQ(index.forgotten(), 2U);
  index.add(*view(furnished(5), T, 1, 5));  // again: replaced
  EXPECT_EQ(index.forgotten(), 2U);
  for (const PlaceCandidate& c : index.query(*view(furnished(5), T, 1, 5), {}, Deadline::never())) {
    EXPECT_NE(c.key.id, 5U);
    EXPECT_GE(c.key.id, 2U);
  }
  EXPECT_TRUE(index.query(*view(furnished(5), T, 2, 5), {1}, Deadline::never()).empty());
}

TEST(PlaceIndex, StopsAtTheDeadline) {
  Arena arena;
  PlaceIndex index{8, arena};
  const Se3 T = test::camera_at({-1.0, 0.2, 1.2}, 0.3);
  for (unsigned seed = 0; seed < 8; ++seed) index.add(*view(furnished(seed), T, 1, seed));
  const ManualClock clock;
  EXPECT_TRUE(index.query(*view(furnished(3), T, 2, 0), {}, Deadline{clock, Duration{0}}).empty());
  EXPECT_EQ(index.stop(), Stop::kDeadline);
}

TEST(PlaceIndex, OddMapletsAreNoTrouble) {
  Arena arena;
  PlaceIndex index{8, arena};
  const Se3 T = test::camera_at({-1.0, 0.2, 1.2}, 0.3);
  const auto room = furnished(1);
  index.add(*view(room, T, 1, 0));
  index.add(*view({}, T, 1, 1));
  index.add(*view({room[0]}, T, 1, 2));
  index.add(*view({room[1], room[2]}, T, 1, 3));
  auto far = view({room[0], room[1], room[3]}, T, 1, 4);
  for (MapletPlane& p : far->planes) {
    p.plane.d = 1e6;
    p.centre *= 1e6;
  }
  index.add(*far);
  for (const auto& asking : {view({}, T, 2, 0), view({room[0]}, T, 2, 1),
                             view({room[1], room[2]}, T, 2, 2), view(room, T, 2, 3)}) {
    for (const PlaceCandidate& c : index.query(*asking, {}, Deadline::never())) {
      for (const PlaceGuess& g : c.guesses) EXPECT_TRUE(g.T_a_b.t.allFinite());
    }
  }
  EXPECT_TRUE(index.query(*far, {}, Deadline::never()).empty());
}

TEST(PlaceIndex, GravityIsUsedWhenKnown) {
  Arena arena;
  PlaceCompare compare;
  const Se3 T_world_a = test::camera_at({-1.0, 0.2, 1.2}, 0.3);
  const Se3 T_world_b = test::camera_at({0.5, -0.2, 1.0}, 1.3);
  auto a = view(furnished(2), T_world_a, 1, 0);
  auto b = view(furnished(2), T_world_b, 2, 0);
  a->up = T_world_a.q.conjugate() * V::UnitZ();
  b->up = T_world_b.q.conjugate() * V::UnitZ();
  const auto da = std::make_unique<PlaceDescriptor>();
  const auto db = std::make_unique<PlaceDescriptor>();
  PlaceDescriptor::describe(*a, *da);
  PlaceDescriptor::describe(*b, *db);
  const auto guesses = compare.guess(*da, *db);
  ASSERT_FALSE(guesses.empty());
  EXPECT_LT(error_m(guesses[0].T_a_b, T_world_a.inverse() * T_world_b), 0.3);
  for (const PlaceGuess& g : guesses) EXPECT_GT(a->up.dot(g.T_a_b.q * b->up), 0.95);
}

TEST(PlaceVerifier, AcceptsTheSamePlaceOnly) {
  Arena arena;
  PlaceVerifier verifier{{}, 16, arena};
  PlaceIndex index{4, arena};
  const Se3 T_world_a = test::camera_at({-1.5, 0.2, 1.2}, 0.1);
  const Se3 T_world_b = test::camera_at({-1.2, -0.3, 1.1}, 0.4);
  const auto here = view(furnished(7), T_world_a, 1, 0);
  const auto elsewhere = view(furnished(8), T_world_a, 1, 1);
  const auto b = view(furnished(7), T_world_b, 2, 0);
  index.add(*here);
  index.add(*elsewhere);
  for (const PlaceCandidate& c : index.query(*b, {}, Deadline::never())) {
    verifier.add(c.key == here->key ? *here : *elsewhere, *b, c.guesses, Deadline::never());
  }
  verifier.judge(NoRelations{});
  int accepted = 0;
  for (const PlaceHypothesis& h : verifier.hypotheses()) {
    if (h.judgement.verdict != Verdict::kAccept) continue;
    ++accepted;
    EXPECT_EQ(h.a, here->key);
    EXPECT_LT(error_m(h.alignment.T_a_b.se3, T_world_a.inverse() * T_world_b), 1e-3);
  }
  EXPECT_EQ(accepted, 1);
}

// Another room by the same builder: everything is there, a little off. How much is too much, the
// run's own maplets say.
TEST(PlaceVerifier, WhatFitsWorseThanOnOnePathIsUndecided) {
  const Se3 T_world_a = test::camera_at({-1.5, 0.2, 1.2}, 0.1);
  const Se3 T_world_b = test::camera_at({-1.2, -0.3, 1.1}, 0.4);
  const auto a = view(furnished(7), T_world_a, 1, 0);
  const auto b = view(furnished(7), T_world_b, 2, 0);
  constexpr double kOff_m = 0.0135;
  for (MapletPlane& p : b->planes) p.plane.d += p.id % 2 == 0 ? kOff_m : -kOff_m;
  PlaceCompare::Guesses guesses;
  guesses.push_back({T_world_a.inverse() * T_world_b, 1.0F});
  const auto judged = [&](double usual) {
    Arena arena;
    PlaceVerifier verifier{{}, 4, arena};
    verifier.note_fit(usual);
    verifier.add(*a, *b, guesses, Deadline::never());
    verifier.judge(NoRelations{});
    EXPECT_GT(verifier.hypotheses().front().alignment.chi2_per_dof, 0.75);
    return verifier.hypotheses().front().judgement;
  };
  EXPECT_EQ(judged(1.0).verdict, Verdict::kAccept);
  EXPECT_EQ(judged(0.1).verdict, Verdict::kUndecided);
  EXPECT_EQ(judged(0.1).reason, "the planes fit worse than those of one path do");
}

// The same furniture twice, half a turn apart: what fits here fits there.
TEST(PlaceVerifier, SymmetricRoomIsUndecided) {
  auto walls = furnished(7);
  const std::size_t count = walls.size();
  const Se3 half{Eigen::Quaterniond{Eigen::AngleAxisd{3.14159265358979, V::UnitZ()}}, V::Zero()};
  for (std::size_t i = 0; i < count; ++i) {
    walls.push_back({half * walls[i].centre, half.q * walls[i].half_a, half.q * walls[i].half_b});
  }
  Arena arena;
  PlaceVerifier verifier{{}, 16, arena};
  PlaceIndex index{4, arena};
  const auto a = view(walls, test::camera_at({-1.5, 0.2, 1.2}, 0.1), 1, 0);
  const auto b = view(walls, test::camera_at({-1.2, -0.3, 1.1}, 0.4), 2, 0);
  index.add(*a);
  const auto& found = index.query(*b, {}, Deadline::never());
  ASSERT_EQ(found.size(), 1U);
  verifier.add(*a, *b, found[0].guesses, Deadline::never());
  verifier.judge(NoRelations{});
  ASSERT_EQ(verifier.hypotheses().size(), 2U);
  EXPECT_EQ(verifier.hypotheses()[0].judgement.verdict, Verdict::kUndecided);
  EXPECT_EQ(verifier.hypotheses()[0].judgement.reason, "another place fits nearly as well");
}

// Two rooms that are alike in all, and what lies a few steps on.
class NextDoor : public testing::TestWithParam<bool> {};

TEST_P(NextDoor, DecidesWhetherRoomsAreOne) {
  const bool same = GetParam();
  const Se3 T_world_a = test::camera_at({-1.5, 0.2, 1.2}, 0.1);
  const Se3 T_world_b = test::camera_at({-1.2, -0.3, 1.1}, 0.4);
  const auto a = view(furnished(7), T_world_a, 1, 0);
  const auto b = view(furnished(7), T_world_b, 2, 0);
  const auto on_a = view(furnished(8), T_world_a, 1, 1);
  const auto on_b = view(furnished(same ? 8 : 9), T_world_b, 2, 1);
  Arena arena;
  PlaceVerifier verifier{{}, 4, arena};
  PlaceCompare::Guesses guesses;
  guesses.push_back({T_world_a.inverse() * T_world_b, 1.0F});
  verifier.add(*a, *b, guesses, Deadline::never());
  verifier.judge(NoRelations{});
  const PlaceHypothesis& h = verifier.hypotheses().front();
  ASSERT_EQ(h.judgement.verdict, Verdict::kAccept);

  const Se3 on{Eigen::Quaterniond::Identity(), V{3.0, 0.0, 0.0}};  // of the world
  Surroundings around;
  around.begin(a->key, b->key, h.alignment.T_a_b.se3);
  around.put_beside_a(on_a->key, T_world_a.inverse() * on * T_world_a);
  // The paths have drifted apart by a hand's breadth since.
  const Se3 drift{Eigen::Quaterniond::Identity(), V{0.1, -0.1, 0.0}};
  around.put_beside_b(on_b->key, T_world_b.inverse() * on * drift * T_world_b);
  int looks = 0;
  while (const Surroundings::Pair* pair = around.next()) {
    const Maplet& x = pair->a == a->key ? *a : *on_a;
    const Maplet& y = pair->b == b->key ? *b : *on_b;
    ASSERT_FALSE(&x == a.get() && &y == b.get());
    if (&x != on_a.get() || &y != on_b.get()) continue;  // walls of one room stand in the other
    ++looks;
    around.weigh(verifier.weigh_around(x, y, *pair, Deadline::never()));
  }
  EXPECT_EQ(looks, 1);
  EXPECT_EQ(around.contradict(), !same);
  verifier.note_around(0, around.contradict());
  verifier.judge(NoRelations{});
  EXPECT_EQ(h.judgement.verdict, same ? Verdict::kAccept : Verdict::kUndecided);
  EXPECT_EQ(h.judgement.reason,
            same ? "planes agree" : "one saw through the other's surfaces around it");
}

INSTANTIATE_TEST_SUITE_P(PlaceVerifier, NextDoor, testing::Bool(),
                         [](const auto& which) { return which.param ? "TheSame" : "Another"; });

TEST(PlaceVerifier, NoTimeIsUndecidedNotAccepted) {
  Arena arena;
  PlaceVerifier verifier{{}, 16, arena};
  const Se3 T = test::camera_at({-1.5, 0.2, 1.2}, 0.1);
  const auto a = view(furnished(7), T, 1, 0);
  const auto b = view(furnished(7), T, 2, 0);
  PlaceCompare::Guesses guesses;
  guesses.push_back({Se3{}, 1.0F});
  const ManualClock clock;
  EXPECT_EQ(verifier.add(*a, *b, guesses, Deadline{clock, Duration{0}}), Stop::kDeadline);
  verifier.judge(NoRelations{});
  for (const PlaceHypothesis& h : verifier.hypotheses()) {
    EXPECT_NE(h.judgement.verdict, Verdict::kAccept);
  }
}

TEST(Saliency, FurnishedBeforeSymmetricBeforeBare) {
  const auto saliency = std::make_unique<Saliency>();
  const Se3 T = test::camera_at({-1.5, 0.2, 1.2}, 0.1);
  auto walls = furnished(7);
  const double furniture = saliency->of(*view(walls, T, 1, 0));
  const Se3 half{Eigen::Quaterniond{Eigen::AngleAxisd{3.14159265358979, V::UnitZ()}}, V::Zero()};
  const std::size_t count = walls.size();
  for (std::size_t i = 0; i < count; ++i) {
    walls.push_back({half * walls[i].centre, half.q * walls[i].half_a, half.q * walls[i].half_b});
  }
  const double symmetric = saliency->of(*view(walls, T, 1, 0));
  walls.resize(5);  // floor and walls
  const double bare = saliency->of(*view(walls, T, 1, 0));
  EXPECT_GT(furniture, 0.2);
  EXPECT_LT(symmetric, 0.5 * furniture);
  EXPECT_LT(bare, 0.3 * furniture);
  EXPECT_EQ(saliency->of(*view({}, T, 1, 0)), 0.0);
  EXPECT_EQ(saliency->of(*view({walls[0]}, T, 1, 0)), 0.0);
}

// A floor with a wall at one end: it is the other end that is open.
TEST(Frontier, LiesWhereSurfacesEndInTheOpen) {
  const Se3 T = test::camera_at({0.0, 0.0, 1.2}, 0.0);
  const auto m = view({{V{2, 0, 0}, V{2, 0, 0}, V{0, 1, 0}},
                       {V{4, 0, 1.3}, V{0, 0, 1.3}, V{0, 1, 0}},
                       {V{2, -1, 1.3}, V{0, 0, 1.3}, V{2, 0, 0}},
                       {V{2, 1, 1.3}, V{2, 0, 0}, V{0, 0, 1.3}},
                       {V{2, 0, 2.6}, V{0, 1, 0}, V{2, 0, 0}}},
                      T, 1, 0);
  const V up = T.q.conjugate() * V::UnitZ();
  const Frontier frontier = find_frontier(*m, up);
  EXPECT_GT(frontier.cells, 50U);
  const Se3 T_maplet_world = T.inverse();
  EXPECT_TRUE(frontier.region.contains(T_maplet_world * V{0.5, 0, 1}));
  EXPECT_TRUE(frontier.region.contains(T_maplet_world * V{-0.8, 0, 1}));
  EXPECT_FALSE(frontier.region.contains(T_maplet_world * V{3.5, 0, 1}));
  EXPECT_EQ(find_frontier(*view({}, T, 1, 1), up).cells, 0U);
}

TEST(Icap, LooksAtItsRegionOnly) {
  const Se3 T_world_a = test::camera_at({-1.5, 0.2, 1.2}, 0.1);
  const Se3 T_world_b = test::camera_at({-1.2, -0.3, 1.1}, 0.4);
  const auto a = view(furnished(7), T_world_a, 1, 0);
  const auto b = view(furnished(7), T_world_b, 2, 0);
  const Transform<MapletA, MapletB> T_a_b{T_world_a.inverse() * T_world_b};
  RegionOfInterest region;  // x right, z forward: the first two metres ahead
  for (const auto& [x, z] : {std::pair{-1.0, 0.0}, {1.0, 0.0}, {1.0, 2.0}, {-1.0, 2.0}}) {
    region.corners.push_back({x, z});
  }
  const auto icap = std::make_unique<Icap>(RegistrationConfig{});
  const auto all = icap->align(*a, *b, T_a_b, 0.1, 0.1, Deadline::never());
  icap->look_at(&region);
  const auto some = icap->align(*a, *b, T_a_b, 0.1, 0.1, Deadline::never());
  ASSERT_TRUE(all && some);
  EXPECT_LT(some->matches, all->matches);
  for (const PlanePair& pair : icap->pairs()) {
    EXPECT_TRUE(region.touches(*a, *pair.a->plane, {}));
  }
}

}  // namespace
}  // namespace maplet
