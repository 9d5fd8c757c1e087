// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/registration/icap.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <memory>

#include "tests/support/maplets.hpp"

namespace maplet {
namespace {

using namespace std::chrono_literals;
using T_A_B = Transform<MapletA, MapletB>;

class TickingClock final : public Clock {
 public:
  explicit TickingClock(Duration tick) : tick_{tick} {}
  [[nodiscard]] Instant now() const noexcept override { return now_ += tick_; }

 private:
  Duration tick_;
  mutable Instant now_{};
};

struct Views {
  std::unique_ptr<Maplet> a = std::make_unique<Maplet>();
  std::unique_ptr<Maplet> b = std::make_unique<Maplet>();
  Se3 T_a_b;
};

Views two_views_of(const std::vector<test::Wall>& walls,
                   const Se3& T_world_a = test::camera_at({2.0, 2.5, 1.2}, 0.2),
                   const Se3& T_world_b = test::camera_at({2.8, 2.2, 1.25}, 0.7)) {
  Views views;
  test::fill(*views.a, walls, T_world_a);
  test::fill(*views.b, walls, T_world_b);
  views.T_a_b = T_world_a.inverse() * T_world_b;
  return views;
}

T_A_B perturbed(const Se3& T, double m = 0.2, double rad = 0.08) {
  Vector6d xi;
  xi << m, -0.5 * m, 0.4 * m, rad, -0.6 * rad, 0.5 * rad;
  return T_A_B{T * Se3::exp(xi)};
}

// The planes' estimates scatter as their covariance says.
void disturb(Maplet& m, std::mt19937& rng) {
  std::normal_distribution<double> normal;
  for (MapletPlane& p : m.planes) {
    const PlaneBasis basis = p.basis();
    const PlaneTangent tangent{basis.u, basis.v, p.plane.n, p.centre};
    Eigen::Vector3d delta;
    for (int i = 0; i < 3; ++i) delta[i] = normal(rng) * std::sqrt(p.covariance(i, i));
    p.plane = tangent.at(delta);
    p.centre -= p.plane.distance(p.centre) * p.plane.n;
  }
}

void expect_near(const Se3& T, const Se3& truth, double m, double rad) {
  const Vector6d off = (truth.inverse() * T).log();
  EXPECT_LT(off.head<3>().norm(), m);
  EXPECT_LT(off.tail<3>().norm(), rad);
}

Expected<MapletAlignment> align(const Views& v, const T_A_B& guess,
                                const RegistrationConfig& config = {}) {
  const auto icap = std::make_unique<Icap>(config);
  return icap->align(*v.a, *v.b, guess, Deadline::never());
}

TEST(Icap, FindsTheExactTransform) {
  const Views v = two_views_of(test::room());
  const auto out = align(v, perturbed(v.T_a_b));
  ASSERT_TRUE(out) << out.error().what;
  expect_near(out->T_a_b.se3, v.T_a_b, 1e-6, 1e-6);
  EXPECT_EQ(out->stop, Stop::kConverged);
  EXPECT_EQ(out->matches, test::room().size());
  EXPECT_GT(out->overlap, 0.9);
  EXPECT_TRUE(out->free_axes.empty());
}

TEST(Icap, KeepsUsableTransformWhenDeadlinePasses) {
  const Views v = two_views_of(test::room());
  const TickingClock clock{1ms};  // every look at the clock costs 1 ms
  const auto icap = std::make_unique<Icap>(RegistrationConfig{});
  const auto out = icap->align(*v.a, *v.b, perturbed(v.T_a_b), Deadline{clock, 20ms});
  ASSERT_TRUE(out) << out.error().what;
  EXPECT_EQ(out->stop, Stop::kDeadline);
  EXPECT_GE(out->iterations, 1U);
  EXPECT_LE(out->iterations, 4U);                     // the votes look, too
  EXPECT_GT(std::sqrt(out->covariance(0, 0)), 0.02);  // of the gates that are left
  expect_near(out->T_a_b.se3, v.T_a_b, 0.1, 0.05);
}

// Not even for the votes: the guess, as unsure as it is.
TEST(Icap, WithoutTimeTheGuessStays) {
  const Views v = two_views_of(test::room());
  const TickingClock clock{1ms};
  const RegistrationConfig config;
  const auto icap = std::make_unique<Icap>(config);
  const Se3 guess = v.T_a_b * Se3::exp((Vector6d() << 0.02, 0, 0.01, 0, 0.01, 0).finished());
  const auto out = icap->align(*v.a, *v.b, T_A_B{guess}, Deadline{clock, 1ms});
  ASSERT_TRUE(out) << out.error().what;
  EXPECT_EQ(out->stop, Stop::kDeadline);
  EXPECT_EQ(out->iterations, 0U);
  expect_near(out->T_a_b.se3, guess, 1e-12, 1e-12);
  EXPECT_GE(std::sqrt(out->covariance(0, 0)), config.gate_m / 3.0);
}

TEST(Icap, IdenticalMapletsStayWhereTheyAre) {
  const Views v =
      two_views_of(test::room(), test::camera_at({2, 2, 1}, 0.3), test::camera_at({2, 2, 1}, 0.3));
  const auto out = align(v, T_A_B{});
  ASSERT_TRUE(out);
  expect_near(out->T_a_b.se3, {}, 1e-9, 1e-9);
  EXPECT_NEAR(out->overlap, 1.0, 1e-9);
}

TEST(Icap, NothingInCommonIsNoOverlap) {
  Views v = two_views_of(test::room());
  v.b->planes.clear();
  EXPECT_EQ(align(v, T_A_B{}).error().code, ErrorCode::kNoOverlap);
  v.a->planes.clear();
  EXPECT_EQ(align(v, T_A_B{}).error().code, ErrorCode::kNoOverlap);
}

// The other side of a wall is another wall.
TEST(Icap, SidesAreToldApart) {
  const std::vector<test::Wall> one{{{3, 2.5, 1.3}, {0, 0, 1.3}, {0, 2.5, 0}}};
  const std::vector<test::Wall> back{{{3, 2.5, 1.3}, {0, 2.5, 0}, {0, 0, 1.3}}};
  Views v;
  test::fill(*v.a, one, test::camera_at({1, 2.5, 1.2}, 0.0));
  test::fill(*v.b, back, test::camera_at({1, 2.5, 1.2}, 0.0));
  EXPECT_FALSE(align(v, T_A_B{}));
}

// Two walls that merely lie in one plane are not the same wall.
TEST(Icap, ExtentsCount) {
  const std::vector<test::Wall> left{{{3, 0.5, 1.3}, {0, 0, 1.3}, {0, 0.5, 0}}};
  const std::vector<test::Wall> right{{{3, 4.5, 1.3}, {0, 0, 1.3}, {0, 0.5, 0}}};
  Views v;
  const Se3 T = test::camera_at({1, 2.5, 1.2}, 0.0);
  test::fill(*v.a, left, T);
  test::fill(*v.b, right, T);
  EXPECT_FALSE(align(v, T_A_B{}));
}

TEST(Icap, CorridorLeavesItsAxisFree) {
  const std::vector<test::Wall> corridor{{{10, 0, 0}, {10, 0, 0}, {0, 1, 0}},
                                         {{10, 0, 2.6}, {0, 1, 0}, {10, 0, 0}},
                                         {{10, -1, 1.3}, {0, 0, 1.3}, {10, 0, 0}},
                                         {{10, 1, 1.3}, {10, 0, 0}, {0, 0, 1.3}}};
  std::mt19937 rng{4};
  for (int run = 0; run < 20; ++run) {
    Views v = two_views_of(corridor, test::camera_at({8, 0, 1.2}, 0.0),
                           test::camera_at({9, 0.1, 1.2}, 0.1));
    disturb(*v.a, rng);
    disturb(*v.b, rng);
    const auto guess =
        T_A_B{v.T_a_b * Se3::exp((Vector6d() << 0.1, 0.02, 0.2, 0, 0, 0).finished())};
    const auto out = align(v, guess);
    ASSERT_TRUE(out);
    ASSERT_EQ(out->free_axes.size(), 1U);
    // The corridor's axis, seen from b.
    const Eigen::Vector3d axis =
        test::camera_at({9, 0.1, 1.2}, 0.1).q.conjugate() * Eigen::Vector3d::UnitX();
    EXPECT_GT(std::abs(out->free_axes[0].head<3>().dot(axis)), 0.99);
    EXPECT_GT(axis.dot(out->covariance.topLeftCorner<3, 3>() * axis), 1.0);
    // Along it the guess stays, across it the walls decide.
    const Eigen::Vector3d off = out->T_a_b.se3.t - v.T_a_b.t;
    const Eigen::Vector3d across = v.T_a_b.q * Eigen::Vector3d{std::cos(0.1), 0, -std::sin(0.1)};
    EXPECT_LT(std::abs(off.dot(across)), 0.01);
  }
}

// A leaf that stands ajar is no axis of the two: no votes, only its plane.
TEST(Icap, OneLeafAjarFixesACorridor) {
  const Eigen::Vector3d along{0.9, 0.42, 0.0};
  const std::vector<test::Wall> corridor{{{10, 0, 0}, {10, 0, 0}, {0, 1, 0}},
                                         {{10, 0, 2.6}, {0, 1, 0}, {10, 0, 0}},
                                         {{10, -1, 1.3}, {0, 0, 1.3}, {10, 0, 0}},
                                         {{10, 1, 1.3}, {10, 0, 0}, {0, 0, 1.3}},
                                         {{11, 0.8, 1.0}, 0.45 * along, {0, 0, 1.0}}};
  std::mt19937 rng{4};
  for (const double off_m : {-0.5, -0.35, 0.35, 0.5}) {
    Views v = two_views_of(corridor, test::camera_at({8, 0, 1.2}, 0.0),
                           test::camera_at({9, 0.1, 1.2}, 0.1));
    disturb(*v.a, rng);
    disturb(*v.b, rng);
    const auto out = align(v, T_A_B{v.T_a_b * Se3{Eigen::Quaterniond::Identity(), {0, 0, off_m}}});
    ASSERT_TRUE(out);
    EXPECT_TRUE(out->free_axes.empty()) << off_m;
    expect_near(out->T_a_b.se3, v.T_a_b, 0.03, 0.0087);
  }
}

// Turned so far that walls fall onto the panels before them.
TEST(Icap, AGuessTurnedOntoOtherAxesIsPutRight) {
  std::vector<test::Wall> walls = test::room();
  const double rad = 0.3;
  const Eigen::Vector3d x{std::cos(rad), std::sin(rad), 0};
  const Eigen::Vector3d y{-std::sin(rad), std::cos(rad), 0};
  for (int i = 0; i < 3; ++i) {
    walls.push_back({{1.0 + i, 3.6, 1.0}, 0.4 * x, {0, 0, 0.8}});
    walls.push_back({{4.4, 1.0 + i, 1.0}, {0, 0, 0.8}, 0.4 * y});
  }
  for (const double turn : {-0.28, -0.2, 0.2, 0.28}) {
    const Views v = two_views_of(walls);
    const Se3 turned{Eigen::Quaterniond{Eigen::AngleAxisd{turn, Eigen::Vector3d::UnitY()}},
                     Eigen::Vector3d::Zero()};
    const auto out = align(v, T_A_B{v.T_a_b * turned});
    ASSERT_TRUE(out);
    expect_near(out->T_a_b.se3, v.T_a_b, 0.03, 0.0087);
  }
}

// What two centimetres are is told by the others, not by what real walls may be off by.
TEST(Icap, AWallThatMovedCountsLessThanThoseThatFit) {
  auto moved = test::room();
  moved[2].centre.x() += 0.02;
  Views v = two_views_of(test::room());
  test::fill(*v.b, moved, test::camera_at({2.8, 2.2, 1.25}, 0.7));
  const auto out = align(v, perturbed(v.T_a_b));
  ASSERT_TRUE(out);
  EXPECT_EQ(out->matches, moved.size());
  expect_near(out->T_a_b.se3, v.T_a_b, 0.003, 0.001);
}

TEST(Icap, OneWallFixesThreeAxes) {
  const std::vector<test::Wall> one{{{3, 2.5, 1.3}, {0, 0, 1.3}, {0, 2.5, 0}}};
  const Views v = two_views_of(one);
  const auto out = align(v, T_A_B{v.T_a_b});
  ASSERT_TRUE(out);
  EXPECT_EQ(out->free_axes.size(), 3U);
  RegistrationConfig config;
  config.min_matches = 2;
  EXPECT_FALSE(align(v, T_A_B{v.T_a_b}, config));
}

TEST(Icap, ParallelPlanesFixThreeAxes) {
  const std::vector<test::Wall> stack{{{3, 2.5, 0}, {3, 0, 0}, {0, 2.5, 0}},
                                      {{2, 2.5, 0.7}, {0.5, 0, 0}, {0, 0.5, 0}},
                                      {{4, 2.5, 1.0}, {0.5, 0, 0}, {0, 0.5, 0}}};
  const Views v = two_views_of(stack);
  const auto out = align(v, T_A_B{v.T_a_b});
  ASSERT_TRUE(out);
  EXPECT_EQ(out->free_axes.size(), 3U);
}

// Three numbers instead of six: exactly in the plane, honest there, and nothing else is asked of
// the planes.
TEST(Icap, PlanarMotionHasThreeUnknowns) {
  const Se3 T_world_a = test::camera_at({2.0, 2.5, 1.2}, 0.2);
  const Se3 T_world_b = test::camera_at({2.8, 2.2, 1.2}, 0.7);
  const PlanarMotion planar{Eigen::Vector3d{0.0, -1.0, 0.0}};
  RegistrationConfig config;
  config.uneven_m = 0.0;
  config.uneven_rad = 0.0;
  std::mt19937 rng{3};
  double sum = 0.0;
  constexpr int kRuns = 100;
  for (int run = 0; run < kRuns; ++run) {
    Views v = two_views_of(test::room(), T_world_a, T_world_b);
    disturb(*v.a, rng);
    disturb(*v.b, rng);
    const auto icap = std::make_unique<Icap>(config);
    icap->hold_to(planar);
    const auto out = icap->align(*v.a, *v.b, perturbed(v.T_a_b), Deadline::never());
    ASSERT_TRUE(out);
    EXPECT_NEAR(out->T_a_b.se3.t.y(), 0.0, 1e-12);
    EXPECT_NEAR(out->T_a_b.se3.q.x(), 0.0, 1e-12);
    EXPECT_TRUE(out->free_axes.empty());
    const Eigen::Vector3d error =
        planar.basis().transpose() * (out->T_a_b.se3.inverse() * v.T_a_b).log();
    const Eigen::Matrix3d spread = planar.basis().transpose() * out->covariance * planar.basis();
    sum += error.dot(spread.inverse() * error) / 3.0;
  }
  EXPECT_GT(sum / kRuns, 0.4);
  EXPECT_LT(sum / kRuns, 1.6);
  // Two walls at an angle fix it; without the floor 3d motion has an axis free.
  const std::vector<test::Wall> corner{test::room()[3], test::room()[5]};
  const Views v = two_views_of(corner, T_world_a, T_world_b);
  const auto icap = std::make_unique<Icap>(config);
  const auto free = icap->align(*v.a, *v.b, T_A_B{v.T_a_b}, Deadline::never());
  icap->hold_to(planar);
  const auto held = icap->align(*v.a, *v.b, T_A_B{v.T_a_b}, Deadline::never());
  ASSERT_TRUE(free && held);
  EXPECT_EQ(free->free_axes.size(), 1U);
  EXPECT_TRUE(held->free_axes.empty());
}

TEST(Icap, PlanesThatAreNotFiniteOrAtTheEndOfTheWorldAreNone) {
  const Views good = two_views_of(test::room());
  const auto reference = align(good, T_A_B{good.T_a_b});
  ASSERT_TRUE(reference);
  const double nan = std::nan("");
  const auto spoil = [&](auto change, double of_planes) {
    Views v = two_views_of(test::room());
    for (std::size_t i = 0;
         static_cast<double>(i) < of_planes * static_cast<double>(v.b->planes.size()); ++i) {
      change(v.b->planes[i]);
    }
    return align(v, T_A_B{v.T_a_b});
  };
  const auto not_finite = [&](MapletPlane& p) { p.plane.n.x() = nan; };
  const auto no_distance = [&](MapletPlane& p) { p.plane.d = nan; };
  const auto no_covariance = [&](MapletPlane& p) { p.covariance(1, 2) = nan; };
  const auto far = [](MapletPlane& p) {
    p.plane.d = 1e6;
    p.centre = -1e6 * p.plane.n;
  };
  const auto expect_some_or_none = [&](const auto& change) {
    const auto some = spoil(change, 0.3);
    ASSERT_TRUE(some);
    expect_near(some->T_a_b.se3, good.T_a_b, 1e-3, 1e-3);
    EXPECT_LT(some->matches, reference->matches);
    const auto none = spoil(change, 1.0);
    ASSERT_FALSE(none);
    EXPECT_EQ(none.error().code, ErrorCode::kNoOverlap);
  };
  expect_some_or_none(not_finite);
  expect_some_or_none(no_distance);
  expect_some_or_none(no_covariance);
  expect_some_or_none(far);
  T_A_B guess{good.T_a_b};
  guess.se3.t.x() = nan;
  const auto bad_guess = align(good, guess);
  ASSERT_FALSE(bad_guess);
  EXPECT_EQ(bad_guess.error().code, ErrorCode::kBadInput);
}

// Also where surfaces are more even than it is told they may be.
TEST(Icap, CovarianceIsHonest) {
  std::mt19937 rng{9};
  for (const bool even : {true, false}) {
    RegistrationConfig config;
    if (even) config.uneven_m = config.uneven_rad = 0.0;
    double sum = 0.0;
    constexpr int kRuns = 100;
    for (int run = 0; run < kRuns; ++run) {
      Views v = two_views_of(test::room());
      disturb(*v.a, rng);
      disturb(*v.b, rng);
      const auto out = align(v, perturbed(v.T_a_b, 0.05, 0.02), config);
      ASSERT_TRUE(out);
      const Vector6d error = (out->T_a_b.se3.inverse() * v.T_a_b).log();
      sum += error.dot(out->covariance.inverse() * error) / 6.0;
    }
    EXPECT_GT(sum / kRuns, even ? 0.5 : 0.3);
    EXPECT_LT(sum / kRuns, 1.6);
  }
}

TEST(Icap, WideGuessesConverge) {
  std::mt19937 rng{21};
  std::uniform_real_distribution<double> unit{-1.0, 1.0};
  int good = 0;
  constexpr int kRuns = 100;
  for (int run = 0; run < kRuns; ++run) {
    Views v = two_views_of(test::room());
    disturb(*v.a, rng);
    disturb(*v.b, rng);
    Vector6d xi;
    for (int i = 0; i < 6; ++i) xi[i] = unit(rng);
    xi.head<3>() *= 0.5 / xi.head<3>().norm() * std::abs(unit(rng));
    xi.tail<3>() *= 0.26 / xi.tail<3>().norm() * std::abs(unit(rng));
    const auto out = align(v, T_A_B{v.T_a_b * Se3::exp(xi)});
    if (!out) continue;
    const Vector6d off = (v.T_a_b.inverse() * out->T_a_b.se3).log();
    good += off.head<3>().norm() < 0.03 && off.tail<3>().norm() < 0.0087 ? 1 : 0;
  }
  EXPECT_GE(good, kRuns * 97 / 100);
}

}  // namespace
}  // namespace maplet
