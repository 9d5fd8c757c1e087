// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// A block of corridors with crossings, side rooms and what stands about in an office building.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "drivers/sim/build.hpp"
#include "drivers/sim/options.hpp"
#include "drivers/sim/world_list.hpp"

namespace maplet::sim {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kHalf = 1.0;   // half a corridor's width, m
constexpr double kHigh = 2.6;   // ceiling
constexpr double kWallM = 0.2;  // thickness at doors
constexpr double kDoor = 1.0;   // opening's width
constexpr Look kWalls{Material::kPlaster, 0.75F};

/// One straight side of the loop, walked anticlockwise; s runs along it.
struct Side {
  double x, y;    ///< where its centre line begins
  double yaw;     ///< its direction
  double length;  ///< to the next corner
  [[nodiscard]] Spot at(double s, double left, double turn) const {
    return {x + s * std::cos(yaw) - left * std::sin(yaw),
            y + s * std::sin(yaw) + left * std::cos(yaw), yaw + turn};
  }
};

Rect around(const Spot& a, const Spot& b) {
  return {std::min(a.x_m, b.x_m), std::min(a.y_m, b.y_m), std::max(a.x_m, b.x_m),
          std::max(a.y_m, b.y_m)};
}

class Loop {
 public:
  explicit Loop(const SimOptions& options)
      : random_{static_cast<std::uint64_t>(options.seed), 0x100b},
        width_{0.3 * options.loop_m},
        depth_{0.2 * options.loop_m} {}

  World make() {
    World world;
    const double w = width_;
    const double d = depth_;
    const Side sides[] = {{0, 0, 0, w}, {w, 0, kPi / 2, d}, {w, d, kPi, w}, {0, d, -kPi / 2, d}};
    for (const Side& side : sides) {
      free_.push_back(around(side.at(-kHalf, -kHalf, 0), side.at(side.length + kHalf, kHalf, 0)));
    }
    // Crossings: a corridor through the block, and at each corner one that leads outwards.
    const double cross = w * random_.uniform(0.42, 0.58);
    free_.push_back({cross - kHalf, 0, cross + kHalf, d});
    for (const Side& side : sides) {
      const double out = random_.uniform(2.5, 4.5);
      free_.push_back(
          around(side.at(side.length, -kHalf, 0), side.at(side.length + kHalf + out, kHalf, 0)));
    }
    Builder builder{world};
    for (const Side& side : sides) furnish(builder, side, cross);
    builder.rooms(free_, kHigh, kWalls, {Material::kTiles, 0.5F}, {Material::kPlaster, 0.9F});
    builder.hang_posters(random_);
    add_cabinet(builder, {cross + 0.7, d / 2, -kPi / 2}, random_, 1.0, 1.9);
    add_cartons(builder, {cross - 0.65, d / 2 - 1.5, kPi / 2}, random_, 2);
    world.route = route();
    return world;
  }

 private:
  /// Walks along a side: every 3 to 4 m something on its right, its left, or both.
  void furnish(Builder& builder, const Side& side, double cross) {
    const bool crossed = std::abs(std::sin(side.yaw)) < 0.5;
    const double crossing = side.yaw == 0.0 ? cross : width_ - cross;
    double room_end = 0.0;
    // Two portals a side, with a lintel under the ceiling: fire doors that stand open.
    for (const double share : {0.3, 0.72}) {
      const double s = side.length * share + random_.spread(0.5);
      if (!crossed || std::abs(s - crossing) > kHalf + 0.4) portal(builder, side, s);
    }
    int step = 0;
    for (double s = 2.2; s < side.length - 2.2; s += random_.uniform(1.5, 2.1), ++step) {
      const bool at_crossing = crossed && std::abs(s - crossing) < kHalf + 0.9;
      const bool right = at_crossing || step % 2 == 0;
      if (right && s > room_end + 2.4 && s < side.length - 3.0 && random_.chance(0.6)) {
        side_room(builder, side, s);
        room_end = s;
      } else if (!right || std::abs(s - room_end) > 1.3) {
        thing(builder, side, s, right ? -1.0 : 1.0);
      }
    }
  }

  void portal(Builder& builder, const Side& side, double s) {
    constexpr double kOut = 0.12;
    constexpr double kThick = 0.22;
    constexpr double kLintel = 0.3;
    for (const double left : {-1.0, 1.0}) {
      builder.box(side.at(s, left * (kHalf - kOut / 2), 0), {0, 0, 0}, {kThick, kOut, kHigh},
                  kWalls);
    }
    builder.box(side.at(s, 0, 0), {0, 0, kHigh - kLintel}, {kThick, 2 * (kHalf - kOut), kLintel},
                kWalls);
  }

  /// Something that stands at the wall and leaves the middle of the corridor free.
  void thing(Builder& builder, const Side& side, double s, double left) {
    const double turn = left > 0 ? 0.0 : kPi;  // its back to the wall
    const auto spot = [&](double deep) {
      return side.at(s, left * (kHalf - deep / 2), turn + random_.spread(0.02));
    };
    switch (random_.index(6)) {
      case 0:  // a pillar
        builder.box(side.at(s, left * (kHalf - 0.1), 0), {0, 0, 0}, {0.35, 0.3, kHigh}, kWalls);
        break;
      case 1: {
        const double high = random_.uniform(0.9, 1.9);
        const double wide = random_.uniform(0.7, 1.1);
        add_cabinet(builder, spot(0.44), random_, wide, high);
        break;
      }
      case 2: {
        const int count = 1 + random_.index(3);
        add_cartons(builder, spot(0.5), random_, count);
        break;
      }
      case 3: {
        const double wide = random_.uniform(0.8, 1.2);
        add_shelf(builder, spot(0.33), random_, wide, 1.9);
        break;
      }
      case 4:  // a bench
        builder.box(spot(0.4), {0, 0, 0}, {1.3, 0.36, 0.45}, {Material::kWood, 0.5F});
        break;
      default:  // a closed door that stands out, a notice board beside it
        builder.box(side.at(s, left * (kHalf - 0.01), 0), {0, 0, 0}, {0.96, 0.14, 2.08},
                    {Material::kWood, 0.55F});
        builder.box(side.at(s + 0.9, left * (kHalf - 0.01), 0), {0, 0, 1.1}, {0.5, 0.06, 0.7},
                    {Material::kWallpaper, 0.7F});
    }
  }

  /// A room on the right hand side, outside of the loop, with an open door.
  void side_room(Builder& builder, const Side& side, double s) {
    const double wide = random_.uniform(3.2, 4.0);
    const double deep = random_.uniform(2.6, 3.4);
    const double near = -kHalf - kWallM;
    free_.push_back(around(side.at(s - kDoor / 2, -kHalf, 0), side.at(s + kDoor / 2, near, 0)));
    const double shift = random_.spread(0.6);
    const double middle = s + shift;
    free_.push_back(
        around(side.at(middle - wide / 2, near, 0), side.at(middle + wide / 2, near - deep, 0)));
    add_door_frame(builder, side.at(s, -kHalf - kWallM / 2, 0), kDoor, kWallM, 2.05, kHigh);
    // The door leaf, open into the room.
    const double open = random_.uniform(1.2, 1.8);
    const Spot hinge = side.at(s - kDoor / 2 + 0.06, near - 0.03, -open);
    builder.box(hinge, {0.42, 0, 0.01}, {0.84, 0.04, 2.0}, {Material::kWood, 0.7F});
    add_table(builder, side.at(middle, near - deep + 0.45, kPi), random_, 1.4, 0.75);
    add_chair(builder, side.at(middle + 0.1, near - deep + 1.1, 0.3), random_);
    add_shelf(builder, side.at(middle + wide / 2 - 0.17, near - deep / 2, -kPi / 2), random_, 1.2,
              1.9);
  }

  [[nodiscard]] Route route() const {
    Route route;
    route.look_ahead = true;
    route.pitch_rad = 0.10;
    constexpr double kCorner = 1.1;  // where the path begins to turn, from the corner
    const double w = width_;
    const double d = depth_;
    const double corners[][2] = {{0, 0}, {w, 0}, {w, d}, {0, d}};
    for (int i = 0; i < 4; ++i) {
      const double* a = corners[i];
      const double* b = corners[(i + 1) % 4];
      const double length = std::hypot(b[0] - a[0], b[1] - a[1]);
      const int steps = static_cast<int>(std::lround((length - 2 * kCorner) / 1.1));
      for (int k = 0; k <= steps; ++k) {
        const double s = (kCorner + (length - 2 * kCorner) * k / steps) / length;
        const double sway = 0.12 * std::sin(2.1 * k + i);  // nobody walks on a line
        const double ux = (b[0] - a[0]) / length;
        const double uy = (b[1] - a[1]) / length;
        route.knots.push_back(
            {a[0] + s * (b[0] - a[0]) - sway * uy, a[1] + s * (b[1] - a[1]) + sway * ux, 1.05, 0});
      }
      const double inward = 0.3;  // cut the corner a little
      const double* c = b;
      route.knots.push_back({c[0] + (c[0] > w / 2 ? -inward : inward),
                             c[1] + (c[1] > d / 2 ? -inward : inward), 1.05, 0});
    }
    return route;
  }

  Random random_;
  double width_;
  double depth_;
  std::vector<Rect> free_;
};

}  // namespace

World make_loop(const SimOptions& options) { return Loop{options}.make(); }

}  // namespace maplet::sim
