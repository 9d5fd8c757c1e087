// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/patches/assign.hpp"

#include <gtest/gtest.h>

#include <array>
#include <random>
#include <vector>

namespace maplet {
namespace {

struct Assigned {
  std::array<std::uint8_t, 80> labels{};
  std::array<std::uint32_t, kMaxAssigned> won{};
  friend bool operator==(const Assigned&, const Assigned&) = default;
};

Assigned run(AssignFunction assign, const std::vector<std::uint16_t>& pixels, int rows,
             const std::vector<LinearDepth>& planes) {
  Assigned out;
  assign(pixels.data(), 9, rows, DepthScale::of(0.001), planes.data(),
         static_cast<int>(planes.size()), out.labels.data(), 10, out.won.data());
  return out;
}

TEST(Assign, FastVariantGivesTheSameLabels) {
  std::mt19937 rng{1};
  std::uniform_real_distribution<float> unit{-1.0F, 1.0F};
  for (int k = 0; k < 500; ++k) {
    std::vector<std::uint16_t> pixels(9 * 8);
    for (auto& p : pixels) {
      p = rng() % 9 == 0 ? static_cast<std::uint16_t>(rng() % 2 * 65535)
                         : static_cast<std::uint16_t>(1500 + rng() % 400);
    }
    std::vector<LinearDepth> planes(1 + rng() % kMaxAssigned);
    for (std::size_t c = 0; c < planes.size(); ++c) {
      planes[c] = {19000.0F + 3000.0F * unit(rng), 100.0F * unit(rng), 100.0F * unit(rng),
                   1.0F / (400.0F + 200.0F * unit(rng)), static_cast<std::int32_t>(7 * c)};
    }
    const int rows = 1 + k % 8;
    EXPECT_EQ(run(best_assign_function(), pixels, rows, planes),
              run(assign_block_plain, pixels, rows, planes));
  }
}

TEST(Assign, PixelsGoToTheNearestPlaneWithinItsLimit) {
  // 32768 steps a 1/m: 1/2 m is 16384.
  const std::vector<LinearDepth> planes{{16384.0F, 0.0F, 0.0F, 1.0F / 300.0F, 3},
                                        {16884.0F, 0.0F, 0.0F, 1.0F / 300.0F, 8}};
  std::vector<std::uint16_t> pixels(9 * 8, 2000);
  pixels[1] = 1941;  // 16882
  pixels[2] = 1800;  // 18204: nobody's
  pixels[3] = 0;
  pixels[4] = 65535;
  for (const AssignFunction assign : {best_assign_function(), &assign_block_plain}) {
    const Assigned out = run(assign, pixels, 2, planes);
    EXPECT_EQ(out.labels[0], 3);
    EXPECT_EQ(out.labels[1], 8);
    for (const std::size_t u : {2, 3, 4}) EXPECT_EQ(out.labels[u], kNobody) << u;
    EXPECT_EQ(out.won[0], 12u);
    EXPECT_EQ(out.won[1], 1u);
  }
}

}  // namespace
}  // namespace maplet
