// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// A seed's world is the same whatever compiled the simulator: recordings, goldens and reports from
// different processors speak of one building.
#include <gtest/gtest.h>

#include "drivers/sim/options.hpp"
#include "drivers/sim/world_list.hpp"

namespace maplet::test {
namespace {

struct Known {
  sim::World (*make)(const sim::SimOptions&);
  int seed;
  std::size_t surfaces;
  double sum;
};

/// Changes when anything moves, or when two things trade places.
double weighted_sum(const sim::World& world) {
  double sum = 0.0, weight = 1.0;
  for (const sim::Surface& surface : world.surfaces) {
    sum += weight * (surface.corner + 2.0 * surface.along + 3.0 * surface.across).sum();
    sum += weight * static_cast<double>(surface.albedo);
    weight = weight < 7.0 ? weight + 1.0 : 1.0;
  }
  return sum;
}

TEST(Worlds, AreTheSameFromEveryCompiler) {
  const Known all[] = {{sim::make_room, 2, 467, 5971.693307882},
                       {sim::make_room, 5, 495, 6350.291096687},
                       {sim::make_loop, 3, 1244, 90317.422631673},
                       {sim::make_loop, 7, 1307, 87230.633044301},
                       {sim::make_symmetric, 1, 462, 3538.426050811}};
  for (const Known& known : all) {
    sim::SimOptions options;
    options.seed = known.seed;
    const sim::World world = known.make(options);
    EXPECT_EQ(world.surfaces.size(), known.surfaces) << "seed " << known.seed;
    EXPECT_NEAR(weighted_sum(world), known.sum, 1e-6) << "seed " << known.seed;
  }
}

}  // namespace
}  // namespace maplet::test
