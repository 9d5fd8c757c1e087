// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

#include "core/base/deadline.hpp"
#include "core/base/static_vector.hpp"
#include "core/geometry/se3.hpp"
#include "core/registration/place_descriptor.hpp"

namespace maplet {

/// One way in which two maplets may lie to each other.
struct PlaceGuess {
  Se3 T_a_b;
  float score = 0.0F;  ///< weight of the planes that coincide / weight of the lighter maplet, 0..1
};

/// How alike the arrangements of two maplets' planes are, and the transforms under which they are.
///
/// Turns: axes of b onto axes of a. Shifts: along each axis, marks of b onto marks of a, by votes.
///
/// Memory   fixed, inside the object (~20 KB).
/// Time     rank: ~10 us. guess: ~100 us.
/// Threads  one caller at a time.
/// Math     docs/math/icap.md, section 7.
class PlaceCompare {
 public:
  static constexpr std::size_t kGuesses = 10;
  using Guesses = StaticVector<PlaceGuess, kGuesses>;

  /// An upper bound of sorts: the best turn's agreement along its axes, each for itself.
  /// @return share of b's weight, 0..1
  [[nodiscard]] float rank(const PlaceDescriptor& a, const PlaceDescriptor& b) noexcept;

  /// The same, near a guess: the turns and shifts that the axes ask for within the gates, and a row
  /// of shifts along the axis that says least. What no axis of the two turns stays as guessed.
  /// @param deadline  looked at every ~5 us: what has been found by then
  [[nodiscard]] Guesses guess_near(const PlaceDescriptor& a, const PlaceDescriptor& b,
                                   const Se3& T_a_b, double gate_m, double gate_rad,
                                   Deadline deadline) noexcept;

  /// The best transforms, no two of them alike, the best first.
  [[nodiscard]] Guesses guess(const PlaceDescriptor& a, const PlaceDescriptor& b) noexcept;

 private:
  static constexpr std::size_t kAxes = PlaceDescriptor::kAxes;
  static constexpr int kBins = 160;
  static constexpr float kBin_m = 0.1F;
  static constexpr std::size_t kPeaks = 4;
  static constexpr std::size_t kTurns = 24;

  struct Peak {
    float shift_m;
    float votes;
  };
  // Votes for shifts along one axis of a under one axis of b, either way round.
  struct Votes {
    float best = -1.0F;  // negative: not counted yet
    StaticVector<Peak, kPeaks> peaks;
  };
  struct Turn {
    Eigen::Matrix3f R;
    float score;
    struct {
      std::int8_t axis_b = -1;  // the one that falls on this axis of a
      bool flipped = false;
    } of_a[kAxes];
  };

  // Shifts within reach_m of middle_m.
  struct Window {
    float middle_m = 0.0F;
    float reach_m = 0.5F * kBins * kBin_m;
    bool want_peaks = false;
  };
  void count_votes(const PlaceAxis& a, const PlaceAxis& b, bool flipped, const Window& window,
                   Votes& out) noexcept;
  [[nodiscard]] const Votes& votes(std::size_t ia, std::size_t ib, bool flipped,
                                   bool want_peaks) noexcept;
  void find_turns(const PlaceDescriptor& a, const PlaceDescriptor& b, bool want_peaks,
                  Deadline deadline) noexcept;
  void add_turn(const Eigen::Matrix3f& R, bool want_peaks) noexcept;
  void try_shifts(const Turn& turn, Guesses& out) noexcept;
  void try_middles(const Eigen::Matrix3f& R, const Eigen::Matrix3f& rows,
                   const StaticVector<Peak, kPeaks>* const peaks[3], Guesses& out) noexcept;
  [[nodiscard]] StaticVector<Peak, kPeaks> middles(const Eigen::Vector3f& axis,
                                                   const Eigen::Vector3f& shift,
                                                   const Eigen::Vector3f& t) noexcept;
  [[nodiscard]] bool turn_onto_axes(float reach_rad, Turn& turn) const noexcept;
  void try_near(const Turn& turn, const Eigen::Vector3f& t, float reach_m, Deadline deadline,
                Guesses& out) noexcept;
  void keep(const Eigen::Matrix3f& R, const Eigen::Vector3f& t, Guesses& out) const noexcept;
  void turn_planes(const Eigen::Matrix3f& R) noexcept;
  [[nodiscard]] float score(const Eigen::Vector3f& t) const noexcept;

  // A plane of b as the present turn has it, and the planes of a that go its way.
  struct Turned {
    Eigen::Vector3f n, u, v, centre;
    struct Along {
      std::uint8_t of_a;
      float off_m;  // without a shift
    };
    StaticVector<Along, PlaceDescriptor::kPlanes> along;
  };

  const PlaceDescriptor* a_ = nullptr;
  const PlaceDescriptor* b_ = nullptr;
  std::array<float, kBins + 2> bins_;
  std::array<Votes, 2 * kAxes * kAxes> votes_;
  StaticVector<Turn, kTurns> turns_;
  StaticVector<Turned, PlaceDescriptor::kPlanes> turned_;
};

}  // namespace maplet
