// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Places that contend for a lost camera.
#include "core/odometry/contenders.hpp"

#include <gtest/gtest.h>

namespace maplet {
namespace {

Contenders::Place place(double x_m, bool near, std::uint32_t segment = 0) {
  return {Se3::exp(x_m * Vector6d::Unit(0)), segment, near};
}

TEST(Contenders, OneWinsWithFourVotes) {
  Contenders contenders;
  for (int i = 0; i < 4; ++i) {
    EXPECT_FALSE(contenders.won(place(0.0, true))) << i;
    contenders.step({});
    contenders.vote(place(0.0, true));
  }
  EXPECT_TRUE(contenders.won(place(0.0, true)));
  EXPECT_FALSE(contenders.won(place(0.0, true, 1))) << "of another segment";
}

TEST(Contenders, AFrameHasOneVoteForAPlace) {
  Contenders contenders;
  contenders.step({});
  for (int i = 0; i < 8; ++i) contenders.vote(place(0.0, true));
  EXPECT_FALSE(contenders.won(place(0.0, true)));
}

TEST(Contenders, ARivalKeepsTheOtherFromWinning) {
  Contenders contenders;
  for (int i = 0; i < 9; ++i) {
    contenders.step({});
    contenders.vote(place(0.0, true));
    if (i % 2 == 0) contenders.vote(place(3.0, true));
  }
  EXPECT_FALSE(contenders.won(place(0.0, true)));
  EXPECT_FALSE(contenders.won(place(3.0, true)));
}

TEST(Contenders, FarFromWhereItIsBelievedTheCameraMustMove) {
  Contenders contenders;
  for (int i = 0; i < 8; ++i) {
    contenders.step({});
    contenders.vote(place(5.0, false));
  }
  EXPECT_FALSE(contenders.won(place(5.0, false)));
  const Se3 step = Se3::exp(0.05 * Vector6d::Unit(0));
  for (int i = 1; i < 6; ++i) {
    contenders.step(step);
    contenders.vote(place(5.0 + 0.05 * i, false));
  }
  EXPECT_TRUE(contenders.won(place(5.25, false)));
}

TEST(Contenders, WhoIsNotVotedForIsForgotten) {
  Contenders contenders;
  contenders.vote(place(0.0, true));
  for (int i = 0; i < 61; ++i) contenders.step({});
  EXPECT_TRUE(contenders.empty());
}

}  // namespace
}  // namespace maplet
