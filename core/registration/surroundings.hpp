// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "core/base/static_vector.hpp"
#include "core/geometry/se3.hpp"
#include "core/maplet/maplet.hpp"
#include "core/registration/evidence.hpp"

namespace maplet {

/// What lies around two places that may be one. A corridor is like another as far as one maplet
/// sees, but soon comes a corner, a door, a room: where their paths put the maplets beside them,
/// one sees through what the other has. begin(), the maplets beside either place, then a pair
/// after the other: next(), weigh().
///
/// Memory   fixed, inside the object
/// Time     O(kMost log kMost) in all, without the evidence of the pairs
/// Threads  one
/// Math     docs/math/icap.md, eq. 24
class Surroundings {
 public:
  static constexpr double kReach_m = 8.0;  ///< along both paths: further away they have drifted

  /// Two maplets that lie beside the places, where these put them.
  struct Pair {
    MapletKey a, b;
    Se3 T_a_b;
    double apart_m = 0.0;  ///< from the places along both paths, turns included (m + rad)
  };

  /// @param T_a_b  of the places as they would lie to each other
  void begin(const MapletKey& a, const MapletKey& b, const Se3& T_a_b) noexcept;
  /// A maplet of a's path, one of b's; any order, the nearest are kept.
  void put_beside_a(const MapletKey& key, const Se3& T_a_key) noexcept;
  void put_beside_b(const MapletKey& key, const Se3& T_b_key) noexcept;

  /// The next pair, nearest first, the places themselves left out; nullptr: there is none.
  [[nodiscard]] const Pair* next() noexcept;
  /// What the pair says under its transform. Incomplete evidence says nothing.
  void weigh(const Evidence& evidence) noexcept;
  /// More was looked through than between maplets of one place.
  [[nodiscard]] bool contradict() const noexcept;
  /// Whether one pair alone is worth a second look.
  [[nodiscard]] static bool contradicts(const Evidence& evidence) noexcept;

 private:
  static constexpr std::size_t kBeside = 8;
  static constexpr std::size_t kMost = 32;

  struct Beside {
    MapletKey key;
    Se3 T_place_key;
    double path_m = 0.0;
  };
  using Besides = StaticVector<Beside, kBeside>;
  static void put(const MapletKey& key, const Se3& T, Besides& besides) noexcept;
  void pair_up() noexcept;

  Se3 T_a_b_;
  Besides beside_a_, beside_b_;  ///< the places themselves first
  StaticVector<Pair, kMost> pairs_;
  bool paired_ = false;
  std::size_t next_ = 0;
  double agreed_ = 0.0;
  double contradicted_ = 0.0;
};

}  // namespace maplet
