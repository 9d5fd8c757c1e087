// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "drivers/sim/random.hpp"
#include "drivers/sim/world.hpp"

namespace maplet::sim {

/// An axis-aligned rectangle of the floor plan, m.
struct Rect {
  double x0, y0, x1, y1;
};

/// What a thing is made of.
struct Look {
  Material material = Material::kWood;
  float albedo = 0.6F;
};

/// A place on the floor with a heading: furniture has its front at -y of this frame, its back (the
/// wall) at +y.
struct Spot {
  double x_m;
  double y_m;
  double yaw_rad = 0.0;
  double z_m = 0.0;
};

/// Puts worlds together and gives coplanar surfaces one plane id.
class Builder {
 public:
  explicit Builder(World& world) : world_{&world} {}

  /// A rectangle seen from the side of along x across.
  void rectangle(const Eigen::Vector3d& corner, const Eigen::Vector3d& along,
                 const Eigen::Vector3d& across, Look look, bool decal = false);
  /// A box, all six sides; `centre` is the middle of its bottom in the spot's frame, yaw and then
  /// pitch (about its x) turn it.
  void box(const Spot& spot, const Eigen::Vector3d& centre, const Eigen::Vector3d& size, Look look,
           double pitch_rad = 0.0);
  /// Walls round a plan made of free rectangles (overlapping or touching), its floor and ceiling.
  void rooms(const std::vector<Rect>& free, double height_m, Look walls, Look floor, Look ceiling);
  /// Posters and notices on the walls that rooms() made: seen in the gray image only.
  void hang_posters(Random& random);

 private:
  std::uint16_t plane_of(const Plane& plane);

  World* world_;
  std::vector<std::size_t> walls_;  ///< of the last rooms()
};

// Furniture. Each stands at its spot, `random` varies its sizes.
void add_table(Builder& builder, const Spot& spot, Random& random, double width_m, double depth_m);
void add_chair(Builder& builder, const Spot& spot, Random& random);
void add_shelf(Builder& builder, const Spot& spot, Random& random, double width_m, double height_m);
void add_cabinet(Builder& builder, const Spot& spot, Random& random, double width_m,
                 double height_m);
void add_sofa(Builder& builder, const Spot& spot, Random& random);
void add_cartons(Builder& builder, const Spot& spot, Random& random, int count);
/// A board that leans against what is behind it.
void add_leaning_board(Builder& builder, const Spot& spot, Random& random);
/// The frame and lintel of a door opening in a wall; the spot is the opening's middle, its x axis
/// runs along the wall.
void add_door_frame(Builder& builder, const Spot& spot, double width_m, double wall_m,
                    double height_m, double ceiling_m);

}  // namespace maplet::sim
