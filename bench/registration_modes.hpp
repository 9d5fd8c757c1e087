// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "bench/registration_data.hpp"
#include "core/registration/config.hpp"

namespace maplet::bench {

/// Of registration_bench's command line.
struct Options {
  std::string mode;
  std::vector<std::string> runs;
  double min_overlap = 0.3;
  int guesses = 5;
  std::size_t stored = 1000;
  std::string lines;
  std::string plot;
  bool verbose = false;
  bool verified = false;  ///< pairs: the verdict looks for better answers, too
  RegistrationConfig registration;
};

/// How far a transform is from the truth.
struct Error {
  double m, deg;
  Vector6d tangent;
};
[[nodiscard]] inline Error error_of(const Se3& T, const Se3& truth) {
  const Vector6d e = (T.inverse() * truth).log();
  return {e.head<3>().norm(), e.tail<3>().norm() * 57.29577951308232, e};
}

using Runs = std::vector<TrueRun>;

// registration_sizes.cpp: what maplets cost and how true they are.
void report_size(const Options& options, const Runs& runs);
void report_fidelity(const Options& options, const Runs& runs);
/// What a sender that stops at a budget sends, and what the receiver has of it.
void report_knob(const Options& options, const Runs& runs);

// registration_pairs.cpp: ICaP from guesses.
void report_pairs(const Options& options, const Runs& runs);
/// The answer at a deadline; without one yet, the guess.
void report_deadline(const Options& options, const Runs& runs);

// registration_places.cpp: without a guess.
/// Lines of `mapletctl match --json RUN_A RUN_B` against the truth.
void report_judge(const Options& options, const Runs& runs);
void report_search(const Options& options, const Runs& runs);

}  // namespace maplet::bench
