// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// ICaP on overlapping pairs, from guesses off by up to 0.5 m and 15 deg.
#include <fmt/core.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <memory>
#include <random>

#include "bench/registration_modes.hpp"
#include "bench/registration_plot.hpp"
#include "bench/timing.hpp"
#include "core/registration/icap.hpp"
#include "core/registration/verdict.hpp"

namespace maplet::bench {

namespace {

// Calls f(a, b, T_a_b, overlap) for pairs of maplets of one world, from different runs or not
// neighbours on their path.
template <class F>
void for_pairs(const Runs& runs, double min_overlap, F f) {
  for (std::size_t ra = 0; ra < runs.size(); ++ra) {
    for (std::size_t rb = ra; rb < runs.size(); ++rb) {
      if (runs[ra].world != runs[rb].world) continue;
      for (std::size_t i = 0; i < runs[ra].maplets.size(); ++i) {
        for (std::size_t k = ra == rb ? i + 1 : 0; k < runs[rb].maplets.size(); ++k) {
          const TrueMaplet& a = runs[ra].maplets[i];
          const TrueMaplet& b = runs[rb].maplets[k];
          const Se3 T_a_b = a.T_world_maplet.inverse() * b.T_world_maplet;
          const double overlap = true_overlap(*a.maplet, *b.maplet, T_a_b);
          if (overlap >= min_overlap) f(a, b, T_a_b, overlap);
        }
      }
    }
  }
}

Se3 perturbation(std::mt19937& rng, double m, double deg) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> unit{0.0, 1.0};
  Eigen::Vector3d t{normal(rng), normal(rng), normal(rng)};
  Eigen::Vector3d r{normal(rng), normal(rng), normal(rng)};
  Vector6d xi;
  xi.head<3>() = t.normalized() * m * unit(rng);
  xi.tail<3>() = r.normalized() * deg * unit(rng) / 57.29577951308232;
  return Se3::exp(xi);
}

/// Thread CPU time: what a deadline is worth does not depend on who else runs.
class CpuClock final : public Clock {
 public:
  [[nodiscard]] Instant now() const noexcept override {
    return Instant{Duration{static_cast<Duration::rep>(1e3 * cpu_us())}};
  }
};

}  // namespace

void report_pairs(const Options& options, const Runs& runs) {
  const auto icap = std::make_unique<Icap>(options.registration);
  const auto verifier = std::make_unique<Verifier>(options.registration);
  Verdict verdict = Verdict::kUndecided;
  int accepted = 0;
  int accepted_wrong = 0;
  const auto align = [&](const Maplet& a, const Maplet& b,
                         const Se3& guess) -> Expected<MapletAlignment> {
    const Transform<MapletA, MapletB> T{guess};
    if (!options.verified) return icap->align(a, b, T, 0.6, 0.35, Deadline::never());
    const Closure c = verifier->verify(a, b, T, 0.6, 0.35, Prior::kGuess, Deadline::never());
    verdict = c.judgement.verdict;
    if (!c.aligned) return fail(ErrorCode::kNoOverlap, "no alignment");
    return c.alignment;
  };
  std::mt19937 rng{1};
  std::vector<double> m, deg, us, nees, us64;
  int tries = 0;
  int good = 0;
  int off_with_free_axes = 0;
  for_pairs(runs, options.min_overlap, [&](const auto& a, const auto& b, const Se3& T, double ov) {
    for (int i = 0; i < options.guesses; ++i) {
      const Se3 guess = T * perturbation(rng, 0.5, 15.0);
      const double before = cpu_us();
      const auto out = align(*a.maplet, *b.maplet, guess);
      const double took = cpu_us() - before;
      ++tries;
      us.push_back(took);
      if (std::max(a.maplet->planes.size(), b.maplet->planes.size()) <= 70) us64.push_back(took);
      if (!out) continue;
      const Error e = error_of(out->T_a_b.se3, T);
      const bool ok = e.m < 0.03 && e.deg < 0.5;
      good += ok ? 1 : 0;
      if (options.verified && verdict == Verdict::kAccept) ++(ok ? accepted : accepted_wrong);
      off_with_free_axes += !ok && !out->free_axes.empty() ? 1 : 0;
      m.push_back(e.m);
      deg.push_back(e.deg);
      // Along a free axis nothing is claimed.
      const double known = std::max(1.0, 6.0 - static_cast<double>(out->free_axes.size()));
      const double n = e.tangent.dot(out->covariance.ldlt().solve(e.tangent)) / known;
      if (e.m < 0.15) nees.push_back(n);
      if (options.verbose && (!ok || i == 0)) {
        fmt::print(
            "{} {} overlap {:.2f} guess {:.2f} m {:.1f} deg: error {:.3f} m {:.2f} deg, {} "
            "matches {} free chi2 {:.2f} nees {:.2f} {}\n",
            a.file, b.file, ov, error_of(guess, T).m, error_of(guess, T).deg, e.m, e.deg,
            out->matches, out->free_axes.size(), out->chi2_per_dof, n, ok ? "" : "OFF");
      }
    }
  });
  if (options.verified)
    fmt::print("{} accepted, {} of them off\n", accepted + accepted_wrong, accepted_wrong);
  double sum = 0.0;
  for (const double n : nees) sum += n;
  fmt::print(
      "{} tries: {:.2f} % within 3 cm and 0.5 deg ({} others with an axis named free); error p50 "
      "{:.4f} m {:.3f} deg, p90 {:.4f} m "
      "{:.3f} deg\n",
      tries, 100.0 * good / std::max(1, tries), off_with_free_axes, percentile(m, 0.5),
      percentile(deg, 0.5), percentile(m, 0.9), percentile(deg, 0.9));
  fmt::print(
      "NEES/dof mean {:.2f} p50 {:.2f}; cpu p50 {:.0f} us p99 {:.0f} us; <= 70 planes p50 "
      "{:.0f} us ({})\n",
      sum / std::max<double>(1.0, static_cast<double>(nees.size())), percentile(nees, 0.5),
      percentile(us, 0.5), percentile(us, 0.99), percentile(us64, 0.5), us64.size());
}

void report_deadline(const Options& options, const Runs& runs) {
  const CpuClock clock;
  std::vector<DeadlinePoint> curve;
  const auto icap = std::make_unique<Icap>(RegistrationConfig{});
  for (const int budget_us : {25, 50, 75, 100, 150, 200, 250, 300, 400, 600, 1000}) {
    std::mt19937 rng{1};
    std::vector<double> m, deg, us, iterations;
    int later = 0;  // by more than one iteration: than the same call takes with no time at all
    for_pairs(runs, options.min_overlap, [&](const auto& a, const auto& b, const Se3& T, double) {
      const Transform<MapletA, MapletB> guess{T * perturbation(rng, 0.5, 15.0)};
      const auto took_us = [&](int budget, auto& out) {
        double least = 1e9;  // the kernel's own work is nobody's lateness
        for (int i = 0; i < 3; ++i) {
          const double before = cpu_us();
          const Deadline deadline{clock, std::chrono::microseconds{budget}};
          out = icap->align(*a.maplet, *b.maplet, guess, deadline);
          least = std::min(least, cpu_us() - before);
        }
        return least;
      };
      Expected<MapletAlignment> out = fail(ErrorCode::kNoOverlap, "");
      const double iteration_us = took_us(0, out);
      us.push_back(took_us(budget_us, out));
      later += us.back() > budget_us + iteration_us ? 1 : 0;
      iterations.push_back(out ? out->iterations : 0);
      const Error e = error_of(out ? out->T_a_b.se3 : guess.se3, T);
      m.push_back(e.m);
      deg.push_back(e.deg);
    });
    curve.push_back({static_cast<double>(budget_us), 1e3 * percentile(m, 0.5),
                     1e3 * percentile(m, 0.9), percentile(us, 0.95) - budget_us});
    fmt::print(
        "{:4d} us: {:2.0f} iterations, error p50 {:.4f} m {:.3f} deg, p90 {:.4f} m {:.3f} deg; "
        "took p50 {:.0f} p95 {:.0f} us; {} of {} later than by an iteration\n",
        budget_us, percentile(iterations, 0.5), percentile(m, 0.5), percentile(deg, 0.5),
        percentile(m, 0.9), percentile(deg, 0.9), percentile(us, 0.5), percentile(us, 0.95), later,
        us.size());
  }
  if (!options.plot.empty()) write_deadline_plot(options.plot, curve);
}

}  // namespace maplet::bench
