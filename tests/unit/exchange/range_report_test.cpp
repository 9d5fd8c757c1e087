// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/exchange/range_report.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace maplet {
namespace {

RangeReport report(std::uint16_t agent, float range_m) {
  return {agent, 9, Stamp{1'234'000}, range_m, 0.1F, {0.0F, 0.6F, 0.8F}, 0.05F};
}

TEST(RangeReport, NonsenseIsNone) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_TRUE(valid(report(3, 2.0F)));
  for (const float range_m : {0.0F, -1.0F, kNan, 2e4F}) EXPECT_FALSE(valid(report(3, range_m)));
  EXPECT_FALSE(valid(report(9, 2.0F)));  // to itself
  RangeReport r = report(3, 2.0F);
  for (const float sigma : {0.0F, -1.0F, kNan, 100.0F}) {
    r.sigma_m = sigma;
    EXPECT_FALSE(valid(r));
  }
  r = report(3, 2.0F);
  r.bearing = {0.0F, 0.0F, 3.0F};
  EXPECT_FALSE(valid(r));
  r.bearing = {kNan, 0.0F, 0.0F};
  EXPECT_FALSE(valid(r));
  r.bearing = {};
  EXPECT_TRUE(valid(r));
  r.stamp = Stamp{-5};
  EXPECT_FALSE(valid(r));
}

}  // namespace
}  // namespace maplet
