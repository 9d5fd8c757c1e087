// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// What odometry_bench says of a run: consistency of covariances, error over time.
#pragma once

#include <fmt/core.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <string>
#include <vector>

#include "core/odometry/tracker.hpp"
#include "tools/eval/evaluate.hpp"

namespace maplet::bench {

inline double percentile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

// What is needed to chain covariances between any two frames.
struct Known {
  Stamp stamp{};
  std::uint32_t keyframe = 0;
  Se3 T_keyframe_camera;
  Matrix6d covariance = Matrix6d::Zero();
  std::size_t free = 0;  // axes
};

struct Link {  // from a keyframe to the next
  Se3 T_previous_this;
  Matrix6d covariance = Matrix6d::Zero();
};

struct Result {
  std::vector<Known> known;
  std::vector<Link> links;  // by keyframe id
  eval::Trajectory estimate;
  eval::Trajectory truth;
  std::vector<double> patches_us, odometry_us, both_us, patch_counts;
  std::uint64_t keyframes = 0;
  TrackerCounters counters;
};

// Of the motion between two frames through the keyframes between them; tangent of the later one.
inline Matrix6d increment_covariance(const Result& result, const Known& from, const Known& to) {
  Matrix6d out = from.covariance;  // of T_keyframe_from, so of T_from_keyframe:
  const Se3 back = from.T_keyframe_camera;
  out = back.adjoint() * out * back.adjoint().transpose();
  for (std::uint32_t k = from.keyframe + 1; k <= to.keyframe; ++k) {
    const Link& link = result.links[k];
    const Matrix6d ad = link.T_previous_this.inverse().adjoint();
    out = ad * out * ad.transpose() + link.covariance;
  }
  const Matrix6d ad = to.T_keyframe_camera.inverse().adjoint();
  return ad * out * ad.transpose() + to.covariance;
}

// Variance of the truth's own jitter from pose to pose: what its third differences have beyond the
// estimate's, of which noise leaves 20 variances (binomials squared). Motion is smooth at that
// rate.
inline Vector6d truth_jitter(const std::vector<eval::Pair>& pairs) {
  Vector6d sum = Vector6d::Zero();
  const auto step = [&](std::size_t i, Se3 eval::Pair::*of) {
    return ((pairs[i].*of).inverse() * (pairs[i + 1].*of)).log();
  };
  if (pairs.size() < 5) return sum;
  for (std::size_t i = 0; i + 3 < pairs.size(); ++i) {
    for (const auto& [of, sign] :
         {std::pair{&eval::Pair::truth, 1.0}, {&eval::Pair::estimate, -1.0}}) {
      const Vector6d third = step(i + 2, of) - 2.0 * step(i + 1, of) + step(i, of);
      sum += sign / 20.0 * third.cwiseAbs2();
    }
  }
  return (sum / static_cast<double>(pairs.size() - 3)).cwiseMax(0.0);
}

// Normalised estimation error squared per degree of freedom, over increments of a second; both
// ends' jitter of the truth is part of the error.
inline void report_consistency(const Result& result, const std::vector<eval::Pair>& pairs,
                               const std::string& file) {
  const Vector6d jitter = truth_jitter(pairs);
  std::vector<double> nees;
  std::ofstream out;
  if (!file.empty()) out.open(file);
  Vector6d squared = Vector6d::Zero();
  Vector6d sigma = Vector6d::Zero();
  Vector6d error_rms = Vector6d::Zero();
  std::size_t a = 0;
  for (std::size_t i = 0, k = 0, j = 0; i < pairs.size(); ++i) {
    while (j < pairs.size() && pairs[j].stamp - pairs[i].stamp < std::chrono::milliseconds{990})
      ++j;
    if (j == pairs.size()) break;
    if (pairs[j].stamp - pairs[i].stamp > std::chrono::milliseconds{1100}) continue;
    while (a < result.known.size() && result.known[a].stamp < pairs[i].stamp) ++a;
    k = std::max(k, a);
    while (k < result.known.size() && result.known[k].stamp < pairs[j].stamp) ++k;
    if (k >= result.known.size()) break;
    Matrix6d covariance = increment_covariance(result, result.known[a], result.known[k]);
    covariance.diagonal() += 2.0 * jitter;
    const Se3 truth = pairs[i].truth.inverse() * pairs[j].truth;
    const Se3 estimate = pairs[i].estimate.inverse() * pairs[j].estimate;
    const Vector6d error = (truth.inverse() * estimate).log();
    nees.push_back(error.dot(covariance.ldlt().solve(error)) / 6.0);
    if (out.is_open()) {
      out << fmt::format("{:.3f},{:.3f}\n", seconds(pairs[i].stamp - pairs[0].stamp), nees.back());
    }
    squared += error.cwiseAbs2().cwiseQuotient(covariance.diagonal());
    sigma += covariance.diagonal();
    error_rms += error.cwiseAbs2();
  }
  if (nees.empty()) return;
  const auto n = static_cast<double>(nees.size());
  double mean = 0.0;
  for (const double value : nees) mean += value / n;
  fmt::print("NEES per dof over 1 s: mean {:.2f} p50 {:.2f} p90 {:.2f}; by axis", mean,
             percentile(nees, 0.5), percentile(nees, 0.9));
  for (int i = 0; i < 6; ++i) fmt::print(" {:.2f}", squared[i] / n);
  fmt::print("; error rms mm, mrad");
  for (int i = 0; i < 6; ++i) fmt::print(" {:.1f}", 1e3 * std::sqrt(error_rms[i] / n));
  fmt::print("; truth's jitter");
  for (int i = 0; i < 6; ++i) fmt::print(" {:.1f}", 1e3 * std::sqrt(jitter[i]));
  fmt::print("; sigma");
  for (int i = 0; i < 6; ++i) fmt::print(" {:.1f}", 1e3 * std::sqrt(sigma[i] / n));
  fmt::print("\n");
}

struct ErrorAt {
  double t_s, mm, deg;
};

inline std::vector<ErrorAt> errors_over_time(const std::vector<eval::Pair>& pairs,
                                             const eval::Evaluation& e) {
  std::vector<ErrorAt> out;
  for (const eval::Pair& pair : pairs) {
    const Se3 error = pair.truth.inverse() * (e.T_truth_estimate * pair.estimate);
    out.push_back({seconds(pair.stamp - pairs.front().stamp), 1e3 * error.t.norm(),
                   error.angle() * 57.29578});
  }
  return out;
}

inline void write_errors(const std::string& file, const std::vector<ErrorAt>& errors) {
  std::ofstream out{file};
  out << "t_s,error_mm,error_deg\n";
  for (const ErrorAt& e : errors) out << fmt::format("{:.3f},{:.3f},{:.4f}\n", e.t_s, e.mm, e.deg);
}

// One curve in a frame with the largest values at its ends.
inline void write_plot(const std::string& file, const std::string& title,
                       const std::vector<ErrorAt>& errors) {
  constexpr double kWidth = 640, kHeight = 160, kLeft = 60, kTop = 24;
  double most = 1.0;
  for (const ErrorAt& e : errors) most = std::max(most, e.mm);
  const double end = std::max(errors.back().t_s, 1e-9);
  std::string points;
  for (const ErrorAt& e : errors) {
    points += fmt::format("{:.1f},{:.1f} ", kLeft + kWidth * e.t_s / end,
                          kTop + kHeight * (1.0 - e.mm / most));
  }
  const auto slash = title.find_last_of('/');
  std::string name = slash == std::string::npos ? title : title.substr(slash + 1);
  for (std::size_t at = 0; (at = name.find('&', at)) != std::string::npos; at += 5) {
    name.replace(at, 1, "&amp;");
  }
  std::ofstream out{file};
  out << fmt::format(
      "<svg xmlns='http://www.w3.org/2000/svg' width='{0}' height='{1}' font-family='sans-serif' "
      "font-size='12'><rect width='{0}' height='{1}' fill='white'/><text x='{2}' y='16'>{3}: "
      "position error after alignment, mm</text><rect x='{2}' y='{4}' width='{5}' height='{6}' "
      "fill='none' stroke='#999'/><text x='{7}' y='{8}' text-anchor='end'>{9:.1f}</text><text "
      "x='{7}' y='{10}' text-anchor='end'>0</text><text x='{11}' y='{12}' "
      "text-anchor='end'>{13:.1f} s</text><polyline fill='none' stroke='#06c' points='{14}'/>"
      "</svg>\n",
      kLeft + kWidth + 20, kTop + kHeight + 24, kLeft, name, kTop, kWidth, kHeight, kLeft - 6,
      kTop + 12, most, kTop + kHeight, kLeft + kWidth, kTop + kHeight + 16, end, points);
}

}  // namespace maplet::bench
