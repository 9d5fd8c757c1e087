// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/sim/sim_source.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "drivers/open_source.hpp"
#include "tests/unit/sim/sim_test.hpp"

namespace maplet {
namespace {

using test::Parameters;
using test::sim;
using namespace std::chrono_literals;

struct Copy {
  std::vector<std::uint16_t> depth;
  std::vector<std::uint16_t> labels;
  std::vector<std::uint8_t> gray;
  friend bool operator==(const Copy&, const Copy&) = default;
};

Copy copy_of(SimSource& source, std::uint64_t index) {
  source.seek(index);
  const auto frame = source.next(Deadline::never());
  EXPECT_TRUE(frame);
  const auto count = static_cast<std::ptrdiff_t>(source.labels().size());
  return {{frame->depth.pixels, frame->depth.pixels + count},
          {source.labels().begin(), source.labels().end()},
          {frame->gray.pixels, frame->gray.pixels + count}};
}

TEST(SimSource, SameUriMakesTheSameBytes) {
  for (const char* world : {"room", "loop", "symmetric"}) {
    const auto a = sim(world, {{"width", "320"}, {"seed", "3"}});
    const auto b = sim(world, {{"width", "320"}, {"seed", "3"}});
    (void)copy_of(*a, 5);  // what came before does not matter
    EXPECT_EQ(copy_of(*a, 17), copy_of(*b, 17)) << world;
    EXPECT_EQ(a->pose(17).se3.t, b->pose(17).se3.t);
  }
}

TEST(SimSource, OtherSeedMakesOtherBytes) {
  const auto a = sim("wall", {{"seed", "3"}, {"phase", "0"}, {"wobble", "0"}});
  const auto b = sim("wall", {{"seed", "4"}, {"phase", "0"}, {"wobble", "0"}});
  const Copy first = copy_of(*a, 2);
  const Copy second = copy_of(*b, 2);
  EXPECT_NE(first.depth, second.depth);  // noise
  EXPECT_NE(first.gray, second.gray);    // texture
  EXPECT_NE(sim("room", {{"seed", "3"}})->planes()[0].d,
            sim("room", {{"seed", "4"}})->planes()[0].d);
}

TEST(SimSource, NoiseOfTwoFramesIsIndependent) {
  const auto source = sim("wall", {{"speed_m_per_s", "0.05"}, {"wobble", "0"}, {"gray", "0"}});
  double sums[3] = {};
  source->seek(0);
  std::vector<double> before;
  for (int k = 0; k < 2; ++k) {
    const auto frame = source->next(Deadline::never());
    ASSERT_TRUE(frame);
    for (std::size_t i = 0; i < source->labels().size(); ++i) {
      const double r =
          1000.0 / frame->depth.pixels[i] - static_cast<double>(source->exact_inverse_depth()[i]);
      if (k == 0) {
        before.push_back(r);
      } else {
        sums[0] += r * before[i];
        sums[1] += r * r;
        sums[2] += before[i] * before[i];
      }
    }
  }
  EXPECT_LT(std::abs(sums[0]) / std::sqrt(sums[1] * sums[2]), 0.02);
}

TEST(SimSource, DeliversWhatWasAskedForAndEnds) {
  const auto source = sim("room", {{"frames", "3"}, {"width", "320"}, {"rate_hz", "15"}});
  EXPECT_EQ(source->length(), 3U);
  for (std::uint64_t i = 0; i < 3; ++i) {
    const auto frame = source->next(Deadline::never());
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->index, i);
    EXPECT_EQ(frame->stamp.count() % 1000, 0);  // whole us
    EXPECT_NEAR(seconds(frame->stamp), static_cast<double>(i) / 15.0, 1e-6);
    EXPECT_EQ(frame->depth.width_px, 320);
    EXPECT_EQ(frame->depth.height_px, 240);
    EXPECT_EQ(frame->gray.width_px, 320);
    EXPECT_EQ(frame->metres_per_unit, 0.001);
    EXPECT_TRUE(frame->camera.valid());
  }
  const auto over = source->next(Deadline::never());
  ASSERT_FALSE(over);
  EXPECT_EQ(over.error().code, ErrorCode::kEnd);
  EXPECT_EQ(source->counters().read, 3U);
}

TEST(SimSource, GrayShowsTexturedDifferentPlanes) {
  const auto source = sim("room", {{"width", "320"}});
  const auto plain = sim("room", {{"width", "320"}, {"texture", "0"}, {"noise", "0"}});
  const Copy textured = copy_of(*source, 40);
  const Copy smooth = copy_of(*plain, 40);
  const auto spread = [](const Copy& copy, std::uint16_t id) {
    double sum = 0.0, squares = 0.0, count = 0.0;
    for (std::size_t i = 0; i < copy.labels.size(); ++i) {
      if (copy.labels[i] != id) continue;
      sum += copy.gray[i];
      squares += copy.gray[i] * copy.gray[i];
      ++count;
    }
    return count < 500 ? -1.0
                       : std::sqrt(std::max(0.0, squares / count - sum * sum / count / count));
  };
  int planes = 0;
  for (std::uint16_t id = 1; id <= source->planes().size(); ++id) {
    if (spread(textured, id) < 0.0) continue;
    ++planes;
    EXPECT_GT(spread(textured, id), 3.0) << "plane " << id;
  }
  EXPECT_GE(planes, 4);
  const auto [low, high] = std::minmax_element(smooth.gray.begin(), smooth.gray.end());
  EXPECT_GT(*high - *low, 30);  // shading alone tells planes apart
}

TEST(SimSource, SymmetricRoomLooksAlikeFromOppositePlaces) {
  const Parameters parameters{{"noise", "0"}, {"gray", "0"}, {"wobble", "0"}, {"width", "320"}};
  const auto source = sim("symmetric", parameters);
  const auto& trajectory = source->trajectory();
  sim::Raster raster{source->world(), source->camera()};
  const Se3 here = trajectory.at(2.0);
  Se3 there = here;
  const Eigen::Quaterniond half_turn{0, 0, 0, 1};
  there.q = half_turn * here.q;
  there.t = half_turn * here.t;
  raster.draw(here);
  const std::vector<float> first{raster.inverse_depth(), raster.inverse_depth() + 320 * 240};
  raster.draw(there);
  int different = 0;
  for (std::size_t i = 0; i < first.size(); ++i) {
    different += std::abs(first[i] - raster.inverse_depth()[i]) > 1e-4F ? 1 : 0;
  }
  EXPECT_LT(different, 320 * 240 / 1000);
}

TEST(SimSource, CoplanarSurfacesAreOnePlane) {
  const auto source = sim("loop", {{"gray", "0"}});
  const auto planes = source->planes();
  for (std::size_t i = 0; i < planes.size(); ++i) {
    EXPECT_NEAR(planes[i].n.norm(), 1.0, 1e-12);
    for (std::size_t j = 0; j < i; ++j) {
      EXPECT_GT((planes[i].n - planes[j].n).norm() + std::abs(planes[i].d - planes[j].d), 1e-9);
    }
  }
}

std::string problem(const std::string& world, const Parameters& parameters) {
  const auto source = open_sim(world, parameters);
  EXPECT_FALSE(source) << world;
  return source ? "" : source.error();
}

TEST(SimUri, ErrorsNameWhatThereIs) {
  EXPECT_NE(problem("kitchen", {}).find("room, loop, corridor"), std::string::npos);
  EXPECT_NE(problem("room", {{"colour", "1"}}).find("seed, agent, frames"), std::string::npos);
  EXPECT_NE(problem("room", {{"noise", "-1"}}).find("from 0 to 10"), std::string::npos);
  EXPECT_NE(problem("room", {{"noise", "nan"}}).find("from 0 to 10"), std::string::npos);
  EXPECT_NE(problem("room", {{"frames", "1.5"}}).find("whole number"), std::string::npos);
  EXPECT_NE(problem("room", {{"frames", ""}}).find("whole number"), std::string::npos);
  EXPECT_NE(problem("room", {{"gray", "yes"}}).find("0 or 1"), std::string::npos);
  EXPECT_NE(problem("room", {{"width", "333"}}).find("640, 320 or 160"), std::string::npos);
  EXPECT_NE(problem("room", {{"min_m", "9"}}).find("max_m"), std::string::npos);
}

TEST(SimUri, OpensByUri) {
  const auto source = open_source("sim:edge?seed=2&frames=1&width=320", SourceOptions{});
  ASSERT_TRUE(source) << source.error().what;
  EXPECT_TRUE((*source)->next(Deadline::never()));
  SourceOptions no_gray;
  no_gray.gray = false;
  const auto plain = open_source("sim:edge?frames=1", no_gray);
  ASSERT_TRUE(plain);
  EXPECT_TRUE((*plain)->next(Deadline::never())->gray.empty());
  const auto wrong = open_source("sim:nowhere", SourceOptions{});
  ASSERT_FALSE(wrong);
  EXPECT_EQ(wrong.error().kind, SourceError::Kind::kUsage);
}

}  // namespace
}  // namespace maplet
