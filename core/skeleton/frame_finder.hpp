// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/base/deadline.hpp"
#include "core/base/static_vector.hpp"
#include "core/skeleton/measure.hpp"
#include "core/skeleton/pose_graph.hpp"

namespace maplet {

/// Finds how two groups stand to each other from sights between them alone: agents that range each
/// other, agents that see the same points, beacons of which only ranges are known.
///
/// A few sights fit several relations (a straight path sees a beacon on its left or its right), so
/// the fit starts from all directions at once. The groups are joined when one answer fits and every
/// other one fits clearly worse; until then they stay side by side and more sights are awaited.
///
/// Memory   two integers a factor, one a node, from the arena.
/// Time     note O(1); work goes on where it stopped, one start at a time (about 0.1 ms), and looks
///          through the waiting sights once a call.
/// Math     docs/math/skeleton.md, section 10.
template <class Space>
class FrameFinder {
 public:
  using Pose = typename Space::Pose;
  using Tangent = typename Space::Tangent;
  using Block = typename Space::Block;

  FrameFinder(PoseGraph<Space>& graph, Arena& arena);

  /// A sight that has been added: waits here when its nodes' groups differ.
  void note(int factor) noexcept;
  /// A factor that is taken out of the graph.
  void forget(int factor) noexcept;
  /// Goes on looking. @return whether two groups were joined
  bool work(Deadline deadline) noexcept;
  /// Every pair that has enough sights has been tried.
  [[nodiscard]] bool idle() const noexcept { return idle_; }

  [[nodiscard]] int waiting() const noexcept { return waiting_count_; }
  [[nodiscard]] std::uint64_t joined() const noexcept { return joined_; }
  /// Times that two relations fitted about equally well.
  [[nodiscard]] std::uint64_t ambiguous() const noexcept { return ambiguous_; }

 private:
  static constexpr int kSamples = 64;
  static constexpr int kCoarseSamples = 16;
  static constexpr int kKept = 6;

  struct Candidate {
    Pose T;  ///< of B's frame in A's
    double cost = 0.0;
  };

  [[nodiscard]] bool begin_pair() noexcept;
  void gather() noexcept;
  [[nodiscard]] int start_count() const noexcept;
  [[nodiscard]] Pose start(int index) const noexcept;
  void keep(const Candidate& candidate) noexcept;
  bool decide() noexcept;
  void sweep() noexcept;
  /// Levenberg-Marquardt on the first `samples`. @return robust cost
  double fit(Pose& T, int samples, int iterations, Block* hessian = nullptr) const noexcept;
  double evaluate(const Pose& T, int samples, Block* h, Tangent* g) const noexcept;
  [[nodiscard]] bool same(const Pose& x, const Pose& y) const noexcept;

  PoseGraph<Space>& graph_;
  std::span<int> waiting_;
  std::span<int> tried_;  ///< by gauge of B: sights there were at the last try
  int waiting_count_ = 0;
  int cursor_ = 0;
  bool idle_ = true;

  // The pair in work.
  bool busy_ = false;
  int group_a_ = -1;
  int group_b_ = -1;
  bool point_ = false;  ///< B is a single point: it has no orientation
  int pair_count_ = 0;
  std::array<int, kSamples> samples_{};
  int sample_count_ = 0;
  measure::Point<Space> centre_a_, centre_b_;
  double range_ = 1.0;  ///< typical, m
  int next_start_ = 0;
  StaticVector<Candidate, kKept + 1> kept_;

  std::uint64_t joined_ = 0;
  std::uint64_t ambiguous_ = 0;
};

extern template class FrameFinder<PlanarSpace>;
extern template class FrameFinder<SpatialSpace>;

}  // namespace maplet
