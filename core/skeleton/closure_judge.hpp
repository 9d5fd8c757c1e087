// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/base/static_vector.hpp"
#include "core/skeleton/marginals.hpp"
#include "core/skeleton/odometry_chains.hpp"
#include "core/skeleton/pose_graph.hpp"

namespace maplet {

/// Where a closure stands.
enum class ClosureState : std::uint8_t {
  kNone,      ///< no closure: odometry, trusted
  kWaiting,   ///< agrees with the graph, which knows too little there for that to
              ///< mean much
  kAccepted,  ///< weight 1
  kRejected,  ///< weight 0; tested again as the graph changes
  kForced,    ///< by hand, either way: never tested
  kNoRoom,    ///< would count, but its elimination does not fit in memory
  kTorn,      ///< weight 0: closures between the same two say two things, about as many each
};

/// How much a closure must show before it counts.
struct JudgePolicy {
  /// Standard deviations are taken that much larger: what is known of odometry may be too sure.
  double inflation = 1.0;
  /// Where the test is blunt, or two groups meet for the first time, another closure must agree.
  /// Else one that nothing speaks against is believed: it has been verified where it was made.
  bool wants_support = true;
};

/// Decides which closures to believe, as they come, and decides again both ways
/// as the graph learns.
///
/// A closure is tested against what the graph already knows: its error at the
/// estimate, with the relative covariance of its nodes. One that fails is out.
/// One that passes where the test is sharp (by chance few wrong ones would) is
/// in. Where it is blunt, the closure waits until another one, given the first,
/// passes a sharp test: two wrong ones seldom agree.
///
/// Memory   13 bytes a factor, and Marginals.
/// Time     consider O(path to the root); review O(closures), one graph update
/// each round. Math     docs/math/skeleton.md, section 8.
template <class Space>
class ClosureJudge {
 public:
  using Tangent = typename Space::Tangent;
  using Block = typename Space::Block;
  using Pose = typename Space::Pose;

  /// @param chains  the agents' odometry, or nullptr: closures next to each other then bear each
  ///   other out by the graph alone
  ClosureJudge(PoseGraph<Space> &graph, Arena &arena, const JudgePolicy &policy = {},
               const OdometryChains<Space> *chains = nullptr);

  /// A closure that has been added with weight 0: decides now, given what the
  /// graph has eliminated. @pre its nodes are; verdicts since need not be
  /// @param compare  with those that wait, where its own test is blunt
  void consider(int factor, bool compare = true) noexcept;
  /// Tests some of the others again, `count` of them.
  void look_again(int count) noexcept;
  /// The whole set once more, at a settled estimate; after a change those that were far from
  /// fitting only once nothing else changes any more. @return whether a verdict changed
  bool review() noexcept;
  /// Takes out all that fail where the estimate stands, and nothing in. @return whether any did
  bool drop_misfits() noexcept;
  /// Takes a closure in that is all there is between two groups and that may() be: nothing can bear
  /// it out, and it bends nothing. @return whether there was one
  template <class May>
  bool accept_lone(May &&may) noexcept {
    for (const int factor : closures())
      if (state_[factor] == ClosureState::kWaiting && may(factor) && alone_between(factor)) {
        accept(factor);
        return true;
      }
    return false;
  }
  void force(int factor, bool accept) noexcept;
  /// Out until the next look, whatever its test says.
  void bar(int factor) noexcept {
    if (state_[factor] == ClosureState::kNone) closures_[closure_count_++] = factor;
    reject(factor);
  }
  /// Out until something else joins the two groups, or all are judged anew: others say otherwise,
  /// and nobody can tell who is right.
  void tear(int factor) noexcept;
  /// Closures, in order of arrival.
  [[nodiscard]] std::span<const int> closures() const noexcept {
    return closures_.first(static_cast<std::size_t>(closure_count_));
  }
  /// How many are in.
  [[nodiscard]] int accepted() const noexcept { return accepted_; }
  /// A factor that is taken out of the graph.
  void forget(int factor) noexcept;

  /// All verdicts but those by hand are forgotten; closures wait, without weight, and are gone
  /// through in this order from now on.
  /// @param order  all closures, and perhaps other factors
  void begin_anew(std::span<const int> order) noexcept;
  [[nodiscard]] ClosureState state(int factor) const noexcept { return state_[factor]; }
  [[nodiscard]] Marginals<Space> &marginals() noexcept { return marginals_; }

 private:
  /// Chi-square, 99 %, three and six degrees of freedom.
  static constexpr double kGate = Space::kDim == 6 ? 16.812 : 11.345;
  /// A test is sharp when a closure between two random places passes it more seldom than this.
  static constexpr double kSharp = 1e-4;
  /// So many of those that are out may pass by chance, of all of them together.
  static constexpr double kByChance = 0.01;
  /// So far beyond the gate it is not looked at again in each round of a review.
  static constexpr float kFar = 10.0F;

  struct Innovation {
    Tangent e;
    Block covariance;
  };

  [[nodiscard]] bool measure(int factor, int slot, Innovation &out) noexcept;
  [[nodiscard]] double chance(const Block &covariance) const noexcept;
  [[nodiscard]] double size_of_errors() const noexcept;
  [[nodiscard]] double scale() const noexcept;
  [[nodiscard]] double strict_scale() const noexcept;
  void turn(int factor, ClosureState to) noexcept;
  [[nodiscard]] bool corroborated(int factor, const Innovation &own) noexcept;
  [[nodiscard]] bool borne_out(int factor) noexcept;
  void shuffle(int factor, const Block &covariance, const Pose &before, const Pose &after) noexcept;
  [[nodiscard]] double sharp() const noexcept {
    return std::min(kSharp, kByChance / (1.0 + rejected_));
  }
  [[nodiscard]] double by_chance(double limit) const noexcept;
  void note_cycle(double chi2) noexcept;
  [[nodiscard]] bool same_places(int factor, int other) const noexcept;
  [[nodiscard]] double cycle(int factor, int other) noexcept;
  void join_if_paired(int factor) noexcept;
  [[nodiscard]] bool alone_between(int factor) const noexcept;
  [[nodiscard]] double without_it(int factor) noexcept;
  void accept(int factor) noexcept;
  void reject(int factor) noexcept;
  void measure_extent() noexcept;
  void note_set_aside() noexcept;

  PoseGraph<Space> &graph_;
  JudgePolicy policy_;
  double gate_;  ///< chi-square, inflated; times scale()
  Marginals<Space> marginals_;
  const OdometryChains<Space> *chains_;
  std::span<ClosureState> state_;
  std::span<float> chance_;  ///< chance(), when it was last measured
  std::span<float> beyond_;  ///< chi2 by the gate then
  std::span<int> closures_;  ///< in order of arrival
  int closure_count_ = 0;
  int accepted_ = 0;
  int rejected_ = 0;
  static constexpr int kZeroBin = 20;
  std::array<int, 24> cycles_{};  ///< by the logarithm of how large they are for their covariance
  int cycle_count_ = 0;
  double local_scale_ = 1.0;
  bool hasty_ = false;  ///< the next review leaves out those that are far beyond the gate
  bool fresh_ = false;  ///< the closure under consideration is looked at for the first time
  std::uint64_t draws_ = 1;
  double expected_ = 0.0;        ///< agreements of shuffled closures, by chance()
  double seen_ = 0.0;            ///< those that there were
  double usual_ = 1.0;           ///< seen to expected
  std::uint64_t set_aside_ = 0;  ///< factors that the graph had no room for, as last looked at
  double doubt_ = 1.0;  ///< chance() of the closure considered last, where it fits as others do
  int cursor_ = 0;
  double extent_ = 1.0;  ///< of the map, m
  int extent_nodes_ = 0;
  StaticVector<int, 32> agreeing_;  ///< with the closure that was asked about last
};

extern template class ClosureJudge<PlanarSpace>;
extern template class ClosureJudge<SpatialSpace>;

}  // namespace maplet
