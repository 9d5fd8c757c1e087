// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "drivers/sim/build.hpp"

namespace maplet::sim {
namespace {

/// A spot in the frame of another.
Spot at(const Spot& base, double x, double y, double yaw = 0.0) {
  const double c = std::cos(base.yaw_rad);
  const double s = std::sin(base.yaw_rad);
  return {base.x_m + c * x - s * y, base.y_m + s * x + c * y, base.yaw_rad + yaw, base.z_m};
}

float tone(Random& random, double middle) {
  return static_cast<float>(middle + random.spread(0.12));
}

}  // namespace

void add_table(Builder& builder, const Spot& spot, Random& random, double width_m, double depth_m) {
  const double height = random.uniform(0.70, 0.78);
  const Look look{Material::kWood, tone(random, 0.6)};
  const double slab = 0.035;
  const double leg = 0.06;
  builder.box(spot, {0, 0, height - slab}, {width_m, depth_m, slab}, look);
  for (const double x : {-1.0, 1.0}) {
    for (const double y : {-1.0, 1.0}) {
      builder.box(spot, {x * (width_m / 2 - 0.08), y * (depth_m / 2 - 0.08), 0},
                  {leg, leg, height - slab}, look);
    }
  }
  const double yaw = random.spread(0.5);
  const double y = random.spread(depth_m / 6);
  Spot top = at(spot, random.spread(width_m / 3), y, yaw);
  top.z_m += height;
  const Look cardboard{Material::kCardboard, tone(random, 0.45)};
  builder.box(top, {0, 0, 0}, {0.30, 0.22, random.uniform(0.08, 0.3)}, cardboard);
}

void add_chair(Builder& builder, const Spot& spot, Random& random) {
  const Look look{Material::kWood, tone(random, 0.4)};
  const double seat = random.uniform(0.42, 0.48);
  builder.box(spot, {0, 0, seat - 0.05}, {0.44, 0.44, 0.05}, look);
  builder.box(spot, {0, 0.20, seat}, {0.44, 0.04, 0.45}, look, -0.15);
  for (const double x : {-0.19, 0.19}) {
    for (const double y : {-0.19, 0.19}) {
      builder.box(spot, {x, y, 0}, {0.04, 0.04, seat - 0.05}, look);
    }
  }
}

void add_shelf(Builder& builder, const Spot& spot, Random& random, double width_m,
               double height_m) {
  const Look look{Material::kWood, tone(random, 0.55)};
  constexpr double kDepth = 0.32;
  constexpr double kBoard = 0.03;
  for (const double side : {-1.0, 1.0}) {
    builder.box(spot, {side * (width_m - kBoard) / 2, 0, 0}, {kBoard, kDepth, height_m}, look);
  }
  builder.box(spot, {0, kDepth / 2 - 0.01, 0}, {width_m - 2 * kBoard, 0.02, height_m}, look);
  const int boards = static_cast<int>(std::lround(height_m / 0.38));
  const double pitch = (height_m - kBoard) / boards;
  for (int i = 0; i <= boards; ++i) {
    builder.box(spot, {0, 0, i * pitch}, {width_m - 2 * kBoard, kDepth, kBoard}, look);
    if (i == boards) break;
    // Books and boxes, a row on each board.
    double x = -width_m / 2 + 0.05;
    for (;;) {
      const double wide = random.uniform(0.08, 0.35);
      if (x + wide > width_m / 2 - 0.05) break;
      if (random.chance(0.75)) {
        const double deep = random.uniform(0.16, 0.27);
        const Look cover{Material::kWallpaper, tone(random, 0.5)};
        builder.box(spot, {x + wide / 2, 0.13 - deep / 2, i * pitch + kBoard},
                    {wide, deep, random.uniform(0.12, pitch - 0.08)}, cover);
      }
      x += wide + random.uniform(0.005, 0.08);
    }
  }
}

void add_cabinet(Builder& builder, const Spot& spot, Random& random, double width_m,
                 double height_m) {
  const Look look{Material::kWood, tone(random, 0.7)};
  builder.box(spot, {0, 0, 0}, {width_m, random.uniform(0.38, 0.48), height_m}, look);
}

void add_sofa(Builder& builder, const Spot& spot, Random& random) {
  const Look look{Material::kCarpet, tone(random, 0.45)};
  builder.box(spot, {0, 0, 0}, {1.8, 0.8, 0.42}, look);
  builder.box(spot, {0, 0.30, 0.42}, {1.8, 0.18, 0.40}, look, -0.18);
  for (const double x : {-0.98, 0.98}) builder.box(spot, {x, 0, 0}, {0.17, 0.8, 0.60}, look);
}

void add_cartons(Builder& builder, const Spot& spot, Random& random, int count) {
  double z = 0.0;
  for (int i = 0; i < count; ++i) {
    const double yaw = random.spread(0.35);
    const double y = random.spread(0.05);
    Spot here = at(spot, random.spread(0.05), y, yaw);
    here.z_m += z;
    const double high = random.uniform(0.25, 0.42);
    const Look look{Material::kCardboard, tone(random, 0.5)};
    builder.box(here, {0, 0, 0}, {random.uniform(0.35, 0.55), random.uniform(0.3, 0.45), high},
                look);
    z += high;
  }
}

void add_leaning_board(Builder& builder, const Spot& spot, Random& random) {
  const double pitch_rad = -random.uniform(0.18, 0.32);
  const Look look{Material::kWallpaper, tone(random, 0.65)};
  builder.box(spot, {0, 0, 0}, {random.uniform(0.6, 0.9), 0.03, random.uniform(1.2, 1.7)}, look,
              pitch_rad);
}

void add_door_frame(Builder& builder, const Spot& spot, double width_m, double wall_m,
                    double height_m, double ceiling_m) {
  const Look look{Material::kWood, 0.8F};
  builder.box(spot, {0, 0, height_m}, {width_m, wall_m, ceiling_m - height_m},
              {Material::kPlaster, 0.75F});
  constexpr double kFrame = 0.07;
  for (const double side : {-1.0, 1.0}) {
    builder.box(spot, {side * (width_m / 2 + kFrame / 2 - 0.03), 0, 0},
                {kFrame, wall_m + 0.04, height_m + 0.04}, look);
  }
  builder.box(spot, {0, 0, height_m - 0.03}, {width_m - 0.06, wall_m + 0.04, kFrame}, look);
}

}  // namespace maplet::sim
