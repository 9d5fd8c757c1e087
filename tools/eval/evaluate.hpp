// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "tools/eval/trajectory.hpp"

namespace maplet::eval {

/// A pose of the truth and the estimate of the same moment.
struct Pair {
  Stamp stamp{};  ///< of the estimate
  Se3 truth;
  Se3 estimate;
};

/// Relative pose error: root mean square over `count` relative motions.
struct RelativeError {
  double m = 0.0;
  double deg = 0.0;
  std::size_t count = 0;  ///< 0: the trajectory holds no such motion, m and deg mean nothing
};

struct Evaluation {
  double ate_rms_m = 0.0;
  double ate_max_m = 0.0;
  RelativeError rpe_frame;  ///< from a pair to the next
  RelativeError rpe_1s;     ///< from a pair to the one a second later
  double path_m = 0.0;      ///< of the truth, over the pairs
  std::size_t pairs = 0;
  Se3 T_truth_estimate;  ///< the alignment: maps the estimate's world into the truth's
};

inline constexpr Duration kAssociationTolerance = std::chrono::milliseconds{20};

/// Pairs each estimate with the truth nearest in time, within the tolerance; a truth serves once,
/// the nearest estimate has it. Nothing is interpolated: that is what the TUM benchmark's and evo's
/// figures mean, and ours are to be compared with theirs.
///
/// Time  O((n + m) log m)
[[nodiscard]] std::vector<Pair> associate(const Trajectory& truth, const Trajectory& estimate,
                                          Duration tolerance = kAssociationTolerance);

/// ATE: rms distance after the rigid motion (no scale) that makes it least (Umeyama 1991).
/// RPE: of E = (Q_i^-1 Q_j)^-1 (P_i^-1 P_j), Q truth and P estimate (Sturm et al. 2012, eq. 1),
/// the length of the translation and the angle.
///
/// Math   docs/math/evaluation.md, eq. 1-4
/// @throws std::runtime_error  for fewer than 3 pairs: they do not fix an alignment
[[nodiscard]] Evaluation evaluate(const std::vector<Pair>& pairs);

}  // namespace maplet::eval
