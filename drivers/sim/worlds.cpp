// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>
#include <numbers>

#include "drivers/sim/build.hpp"
#include "drivers/sim/options.hpp"
#include "drivers/sim/world_list.hpp"

namespace maplet::sim {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr Look kWall{Material::kPlaster, 0.75F};
constexpr Look kPaper{Material::kWallpaper, 0.65F};
constexpr Look kFloor{Material::kCarpet, 0.45F};
constexpr Look kCeiling{Material::kPlaster, 0.9F};
// Headings of furniture that stands at a wall.
constexpr double kNorth = 0.0;
constexpr double kSouth = kPi;
constexpr double kEast = -kPi / 2;
constexpr double kWest = kPi / 2;

struct Entry {
  std::string_view name;
  World (*make)(const SimOptions&);
};
constexpr std::array<Entry, 6> kWorlds{{{"room", make_room},
                                        {"loop", make_loop},
                                        {"corridor", make_corridor},
                                        {"symmetric", make_symmetric},
                                        {"wall", make_wall},
                                        {"edge", make_edge}}};

/// Goes to and fro along x, always looking along x.
Route to_and_fro(double from_m, double to_m, double z_m, double pitch_rad) {
  Route route;
  route.pitch_rad = pitch_rad;
  const int steps = std::max(4, static_cast<int>(std::lround(std::abs(to_m - from_m))));
  for (int i = 0; i < steps; ++i)
    route.knots.push_back({from_m + (to_m - from_m) * i / steps, 0, z_m, 0});
  for (int i = steps; i > 0; --i)
    route.knots.push_back({from_m + (to_m - from_m) * i / steps, 0, z_m, 0});
  return route;
}

/// Once round an ellipse, looking across it and a little about.
Route look_across(double a_m, double b_m, double z_m, double pitch_rad) {
  Route route;
  route.pitch_rad = pitch_rad;
  constexpr int kKnots = 12;
  for (int i = 0; i < kKnots; ++i) {
    const double angle = 2 * kPi * i / kKnots;
    route.knots.push_back({a_m * std::cos(angle), b_m * std::sin(angle),
                           z_m + 0.06 * std::sin(2 * angle + 1),
                           angle + kPi + 0.25 * std::sin(2 * angle)});
  }
  return route;
}

}  // namespace

World make_room(const SimOptions& options) {
  World world;
  Builder builder{world};
  Random random{static_cast<std::uint64_t>(options.seed), 0x400d};
  const double w = 3.0 + random.spread(0.15);  // half the room, m
  const double d = 2.5 + random.spread(0.15);
  constexpr double kHigh = 2.7;
  // A window recess in the north wall, an alcove in the south wall, a door opening in the east.
  const double window = random.uniform(-0.9, -0.3);
  const double door = random.uniform(0.4, 0.9);
  builder.rooms({{-w, -d, w, d},
                 {window, d, window + 1.5, d + 0.25},
                 {-2.2, -d - 0.6, -0.6, -d},
                 {w, door, w + 0.2, door + 0.9},
                 {w + 0.2, door - 0.6, w + 1.6, door + 1.5}},
                kHigh, kWall, kFloor, kCeiling);
  builder.hang_posters(random);
  builder.box({window + 0.75, d + 0.125}, {0, 0, 0}, {1.5, 0.25, 0.9}, kWall);
  builder.box({window + 0.75, d + 0.125}, {0, 0, 2.2}, {1.5, 0.25, kHigh - 2.2}, kWall);
  add_door_frame(builder, {w + 0.1, door + 0.45, kEast}, 0.9, 0.2, 2.05, kHigh);
  const auto near = [&](double x, double y, double yaw) {
    return Spot{x + random.spread(0.06), y + random.spread(0.03), yaw + random.spread(0.04)};
  };
  add_shelf(builder, {w - 0.17, -0.9, kEast}, random, 1.6, 2.0);
  add_table(builder, near(-1.9, d - 0.45, kNorth), random, 1.4, 0.7);
  add_chair(builder, near(-1.7, d - 1.0, kNorth + kPi + 0.4), random);
  add_cabinet(builder, near(2.2, d - 0.24, kNorth), random, 0.9, 1.1);
  add_cartons(builder, near(1.2, d - 0.35, kNorth), random, 2);
  add_sofa(builder, near(-w + 0.5, -0.6, kWest), random);
  add_cabinet(builder, near(-1.4, -d - 0.35, kSouth), random, 1.2, 1.8);
  add_table(builder, near(1.1, -d + 0.5, kSouth), random, 1.6, 0.8);
  add_chair(builder, near(0.9, -d + 1.15, 0.3), random);
  add_leaning_board(builder, {0.0, -d + 0.45, kSouth}, random);
  add_cartons(builder, near(w - 0.5, -d + 0.45, 0.6), random, 3);
  builder.box(near(0.15, 0.1, 0.4), {0, 0, 0}, {0.9, 0.55, 0.42}, {Material::kWood, 0.55F});
  world.route = look_across(1.25, 1.0, 1.25, 0.16);
  return world;
}

World make_corridor(const SimOptions& options) {
  World world;
  Builder builder{world};
  const double beyond = options.max_m + 4.0;  // the ends never come into view
  builder.rooms({{-beyond, -0.9, options.length_m + beyond, 0.9}}, 2.5, kWall, kFloor, kCeiling);
  world.route = to_and_fro(0, options.length_m, 1.0, 0.05);
  return world;
}

World make_symmetric(const SimOptions& options) {
  World world;
  Builder builder{world};
  Random random{static_cast<std::uint64_t>(options.seed), 0x5e77};
  const Random same = random;
  // Everything is there twice: half a turn about the middle maps the room onto itself.
  builder.rooms({{-3, -3, 3, 3}}, 2.6, kWall, kFloor, kCeiling);
  for (const double side : {0.0, kPi}) {
    random = same;
    const auto turned = [side](double x, double y, double yaw) {
      return side == 0.0 ? Spot{x, y, yaw} : Spot{-x, -y, yaw + kPi};
    };
    add_shelf(builder, turned(2.83, 1.2, kEast), random, 1.4, 1.8);
    add_cabinet(builder, turned(2.7, -1.6, kEast), random, 1.0, 1.1);
    add_table(builder, turned(-0.8, 2.5, kNorth), random, 1.4, 0.8);
    add_cartons(builder, turned(1.4, 2.5, kNorth), random, 2);
  }
  world.route = look_across(1.2, 1.2, 1.2, 0.14);
  return world;
}

World make_wall(const SimOptions&) {
  World world;
  Builder builder{world};
  builder.rectangle({3, -50, -50}, {0, 0, 100}, {0, 100, 0}, kPaper);
  world.route = to_and_fro(0, 1.5, 1.2, 0.0);
  return world;
}

World make_edge(const SimOptions&) {
  World world;
  Builder builder{world};
  // Two walls that meet in a vertical edge at x = 3 m, one to each side.
  builder.rectangle({3, 0, -50}, {0, 0, 100}, {-50, 50, 0}, kPaper);
  builder.rectangle({3, 0, -50}, {-40, -60, 0}, {0, 0, 100}, kPaper);
  world.route = to_and_fro(0, 1.2, 1.2, 0.0);
  return world;
}

std::string world_names() {
  std::string names;
  for (const Entry& entry : kWorlds) {
    if (!names.empty()) names += ", ";
    names += entry.name;
  }
  return names;
}

bool is_world(std::string_view name) {
  for (const Entry& entry : kWorlds) {
    if (entry.name == name) return true;
  }
  return false;
}

World make_world(std::string_view name, const SimOptions& options) {
  for (const Entry& entry : kWorlds) {
    if (entry.name == name) return entry.make(options);
  }
  std::terminate();  // a caller that did not ask is_world()
}

}  // namespace maplet::sim
