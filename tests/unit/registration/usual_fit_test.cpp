// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/registration/usual_fit.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace maplet {
namespace {

TEST(UsualFit, NothingKnownForbidsNothing) {
  UsualFit fit;
  EXPECT_TRUE(std::isinf(fit.limit()));
  fit.note(std::numeric_limits<double>::quiet_NaN());  // a link without planes
  EXPECT_TRUE(std::isinf(fit.limit()));
}

TEST(UsualFit, AGoodSensorKeepsTheFloorAndABadOneRaisesIt) {
  UsualFit good;
  for (int i = 0; i < 20; ++i) good.note(0.01 * i);
  EXPECT_EQ(good.limit(), 0.7);
  UsualFit bad;
  for (int i = 0; i < 20; ++i) bad.note(0.8);
  EXPECT_GE(bad.limit(), 2.0);
  EXPECT_LT(bad.limit(), 2.0 * std::exp2(0.25) + 1e-9);
}

TEST(UsualFit, OneBadLinkOfManyDoesNotRaiseIt) {
  UsualFit fit;
  for (int i = 0; i < 30; ++i) fit.note(0.1);
  fit.note(50.0);
  EXPECT_EQ(fit.limit(), 0.7);
}

TEST(UsualFit, AnyNumberIsTaken) {
  UsualFit fit;
  for (const double x : {0.0, -1.0, 1e300, 1e-300}) fit.note(x);
  EXPECT_GT(fit.limit(), 1.0);
}

}  // namespace
}  // namespace maplet
