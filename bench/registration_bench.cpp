// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Maplets against the truth: size, ICaP from guesses, finding places from nothing, deadlines.
//
//   registration_bench MODE FOLDER=SOURCE...    folders of mapletd --out and what they were made of
//     size       bytes and ratio to the point clouds they replace
//     fidelity   points of the keyframes on the maplets, cells that were looked through
//     pairs      overlapping pairs, guesses off by up to 0.5 m and 15 deg: errors, NEES, CPU time
//     judge      lines of `mapletctl match --json` of two runs (--lines FILE)
//     search     CPU time of a query among --stored maplets
//     deadline   ICaP's error at deadlines of so much CPU time (--plot FILE.svg)
//     knob       size and fidelity of what is sent within 1, 2, 4 and 15 KB
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <Eigen/Cholesky>
#include <cmath>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <span>

#include "bench/registration_data.hpp"
#include "bench/registration_fidelity.hpp"
#include "bench/registration_plot.hpp"
#include "bench/timing.hpp"
#include "core/registration/icap.hpp"
#include "core/registration/place_index.hpp"

namespace {

using namespace maplet;
using namespace maplet::bench;

struct Options {
  std::string mode;
  std::vector<std::string> runs;
  double min_overlap = 0.3;
  int guesses = 5;
  std::size_t stored = 1000;
  std::string lines;
  std::string plot;
  bool verbose = false;
  RegistrationConfig registration;
};

struct Error {
  double m, deg;
  Vector6d tangent;
};
Error error_of(const Se3& T, const Se3& truth) {
  const Vector6d e = (T.inverse() * truth).log();
  return {e.head<3>().norm(), e.tail<3>().norm() * 57.29577951308232, e};
}

// Calls f(a, b, T_a_b, overlap) for pairs of maplets of one world, from different runs or not
// neighbours on their path.
template <class F>
void for_pairs(const std::vector<TrueRun>& runs, double min_overlap, F f) {
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

void report_size(std::span<const TrueRun> runs) {
  for (const TrueRun& run : runs) {
    double sum = 0.0;
    double most = 0.0;
    double planes = 0.0;
    for (const TrueMaplet& m : run.maplets) {
      const auto bytes = static_cast<double>(m.bytes);
      sum += bytes;
      most = std::max(most, bytes);
      planes += static_cast<double>(m.maplet->planes.size());
    }
    const double count = std::max<double>(1.0, static_cast<double>(run.maplets.size()));
    fmt::print("{}: {} maplets, bytes mean {:.0f} max {:.0f}, planes mean {:.0f}\n", run.folder,
               run.maplets.size(), sum / count, most, planes / count);
  }
}

void report_fidelity(std::span<const TrueRun> runs) {
  for (const TrueRun& run : runs) {
    const Fidelity f = fidelity_of(run);
    fmt::print(
        "{}: {:.1f} % of {} points within 2 cm, rms {:.1f} mm; {} of {} cells ({:.2f} %) "
        "looked through\n",
        run.folder, 100.0 * static_cast<double>(f.near) / static_cast<double>(f.points), f.points,
        1e3 * std::sqrt(f.squares_m2 / static_cast<double>(f.near)), f.free, f.cells,
        100.0 * static_cast<double>(f.free) / static_cast<double>(f.cells));
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

void report_pairs(const Options& options, const std::vector<TrueRun>& runs) {
  const auto icap = std::make_unique<Icap>(options.registration);
  std::mt19937 rng{1};
  std::vector<double> m, deg, us, nees, us64;
  int tries = 0;
  int good = 0;
  int off_with_free_axes = 0;
  for_pairs(runs, options.min_overlap, [&](const auto& a, const auto& b, const Se3& T, double ov) {
    for (int i = 0; i < options.guesses; ++i) {
      const Se3 guess = T * perturbation(rng, 0.5, 15.0);
      const double before = cpu_us();
      const auto out = icap->align(*a.maplet, *b.maplet, Transform<MapletA, MapletB>{guess}, 0.6,
                                   0.35, Deadline::never());
      const double took = cpu_us() - before;
      ++tries;
      us.push_back(took);
      if (std::max(a.maplet->planes.size(), b.maplet->planes.size()) <= 70) us64.push_back(took);
      if (!out) continue;
      const Error e = error_of(out->T_a_b.se3, T);
      const bool ok = e.m < 0.03 && e.deg < 0.5;
      good += ok ? 1 : 0;
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

// Lines of `mapletctl match --json RUN_A RUN_B` against the truth.
void report_judge(const Options& options, const std::vector<TrueRun>& runs) {
  if (runs.size() != 2) throw std::runtime_error{"judge takes two runs"};
  std::map<std::pair<std::string, std::string>, nlohmann::json> lines;
  std::ifstream in{options.lines};
  for (std::string line; std::getline(in, line);) {
    const auto pair = nlohmann::json::parse(line);
    lines[{pair["a"].get<std::string>(), pair["b"].get<std::string>()}] = pair;
  }
  const bool same_world = runs[0].world == runs[1].world;
  int wanted = 0;
  int found = 0;
  int accepted = 0;
  int wrong = 0;
  int good = 0;
  std::vector<double> m, deg, nees;
  for (const TrueMaplet& a : runs[0].maplets) {
    for (const TrueMaplet& b : runs[1].maplets) {
      const Se3 truth = a.T_world_maplet.inverse() * b.T_world_maplet;
      const double overlap = same_world ? true_overlap(*a.maplet, *b.maplet, truth) : 0.0;
      wanted += overlap >= 0.5 ? 1 : 0;
      const auto line = lines.find({a.file, b.file});
      const bool is_accepted = line != lines.end() && line->second["verdict"] == "accept";
      Error e{0.0, 0.0, Vector6d::Zero()};
      if (line != lines.end()) {
        const auto& p = line->second["T_a_b"];
        e = error_of({Eigen::Quaterniond{p[6].get<double>(), p[3].get<double>(), p[4].get<double>(),
                                         p[5].get<double>()},
                      {p[0].get<double>(), p[1].get<double>(), p[2].get<double>()}},
                     truth);
      }
      if (options.verbose && (is_accepted || overlap >= 0.5)) {
        fmt::print("{} {} overlap {:.2f} error {:.3f} m {:.2f} deg {}\n", a.file, b.file, overlap,
                   e.m, e.deg,
                   line == lines.end() ? "not listed"
                                       : line->second["verdict"].get<std::string>() + ": " +
                                             line->second["reason"].get<std::string>());
      }
      if (!is_accepted) continue;
      ++accepted;
      const bool right = same_world && e.m < 0.15 && e.deg < 4.0;
      wrong += right ? 0 : 1;
      good += same_world && e.m < 0.05 && e.deg < 2.0 ? 1 : 0;
      found += right && overlap >= 0.5 ? 1 : 0;
      if (!right) continue;
      m.push_back(e.m);
      deg.push_back(e.deg);
      Matrix6d covariance;
      for (int i = 0; i < 36; ++i) covariance(i / 6, i % 6) = line->second["covariance"][i];
      nees.push_back(e.tangent.dot(covariance.ldlt().solve(e.tangent)) / 6.0);
    }
  }
  fmt::print(
      "{} pairs verified, {} accepted, {} of them another place, {} within 5 cm and 2 deg; "
      "overlap >= 50 %: {} of {} found; error p50 {:.3f} m {:.2f} deg max {:.3f} m {:.2f} deg; "
      "NEES/dof p50 {:.2f}\n",
      lines.size(), accepted, wrong, good, found, wanted, percentile(m, 0.5), percentile(deg, 0.5),
      percentile(m, 1.0), percentile(deg, 1.0), percentile(nees, 0.5));
}

void report_search(const Options& options, const std::vector<TrueRun>& runs) {
  Arena arena;
  PlaceIndex index{options.stored, arena};
  std::uint32_t id = 0;
  const auto copy = std::make_unique<Maplet>();
  while (index.size() < options.stored) {
    for (const TrueRun& run : runs) {
      for (const TrueMaplet& m : run.maplets) {
        *copy = *m.maplet;
        copy->key = {9, 1, id++};
        index.add(*copy);
      }
    }
  }
  std::vector<double> us;
  for (const TrueRun& run : runs) {
    for (const TrueMaplet& m : run.maplets) {
      const double before = cpu_us();
      (void)index.query(*m.maplet, -1, Deadline::never());
      us.push_back(cpu_us() - before);
    }
  }
  fmt::print("{} stored, {:.0f} bytes each: query cpu p50 {:.2f} ms p99 {:.2f} ms max {:.2f} ms\n",
             index.size(), static_cast<double>(sizeof(PlaceDescriptor)), 1e-3 * percentile(us, 0.5),
             1e-3 * percentile(us, 0.99), 1e-3 * percentile(us, 1.0));
}

/// Thread CPU time: what a deadline is worth does not depend on who else runs.
class CpuClock final : public Clock {
 public:
  [[nodiscard]] Instant now() const noexcept override {
    return Instant{Duration{static_cast<Duration::rep>(1e3 * cpu_us())}};
  }
};

// The answer at a deadline; without one yet, the guess.
void report_deadline(const Options& options, const std::vector<TrueRun>& runs) {
  const CpuClock clock;
  std::vector<DeadlinePoint> curve;
  const auto icap = std::make_unique<Icap>(RegistrationConfig{});
  for (const int budget_us : {25, 50, 75, 100, 150, 200, 250, 300, 400, 600, 1000}) {
    std::mt19937 rng{1};
    std::vector<double> m, deg, us, iterations;
    for_pairs(runs, options.min_overlap, [&](const auto& a, const auto& b, const Se3& T, double) {
      const Transform<MapletA, MapletB> guess{T * perturbation(rng, 0.5, 15.0)};
      const double before = cpu_us();
      const Deadline deadline{clock, std::chrono::microseconds{budget_us}};
      const auto out = icap->align(*a.maplet, *b.maplet, guess, deadline);
      us.push_back(cpu_us() - before);
      iterations.push_back(out ? out->iterations : 0);
      const Error e = error_of(out ? out->T_a_b.se3 : guess.se3, T);
      m.push_back(e.m);
      deg.push_back(e.deg);
    });
    curve.push_back({static_cast<double>(budget_us), 1e3 * percentile(m, 0.5),
                     1e3 * percentile(m, 0.9), percentile(us, 0.95) - budget_us});
    fmt::print(
        "{:4d} us: {:2.0f} iterations, error p50 {:.4f} m {:.3f} deg, p90 {:.4f} m {:.3f} deg; "
        "took p50 {:.0f} p95 {:.0f} us\n",
        budget_us, percentile(iterations, 0.5), percentile(m, 0.5), percentile(deg, 0.5),
        percentile(m, 0.9), percentile(deg, 0.9), percentile(us, 0.5), percentile(us, 0.95));
  }
  if (!options.plot.empty()) write_deadline_plot(options.plot, curve);
}

// What a sender that stops at a budget sends, and what the receiver has of it.
void report_knob(const std::vector<TrueRun>& runs) {
  for (const std::size_t budget : {1024, 2048, 4096, 15360}) {
    for (const TrueRun& run : runs) {
      const TrueRun part = within(run, budget);
      fmt::print("within {} bytes, ", budget);
      report_size({&part, 1});
      report_fidelity({&part, 1});
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app{"Maplets against the truth"};
  app.add_option("mode", options.mode, "size, fidelity, knob, pairs, judge, search or deadline")
      ->required();
  app.add_option("runs", options.runs, "FOLDER=SOURCE: of mapletd --out, and made of what")
      ->required();
  app.add_option("--min-overlap", options.min_overlap, "Of pairs, share of the smaller maplet");
  app.add_option("--guesses", options.guesses, "For each pair");
  app.add_option("--lines", options.lines, "What mapletctl match --json printed");
  app.add_option("--plot", options.plot, "SVG of mode deadline");
  app.add_option("--stored", options.stored, "Maplets in the index");
  app.add_option("--uneven-m", options.registration.uneven_m, "As registration.uneven_m");
  app.add_option("--uneven-rad", options.registration.uneven_rad, "As registration.uneven_rad");
  app.add_flag("--verbose", options.verbose, "A line a try");
  CLI11_PARSE(app, argc, argv);
  try {
    std::vector<TrueRun> runs;
    for (const std::string& text : options.runs) runs.push_back(read_true_run(text));
    if (options.mode == "size") {
      report_size(runs);
    } else if (options.mode == "fidelity") {
      report_fidelity(runs);
    } else if (options.mode == "pairs") {
      report_pairs(options, runs);
    } else if (options.mode == "judge") {
      report_judge(options, runs);
    } else if (options.mode == "search") {
      report_search(options, runs);
    } else if (options.mode == "knob") {
      report_knob(runs);
    } else if (options.mode == "deadline") {
      report_deadline(options, runs);
    } else {
      throw std::runtime_error{"no such mode: " + options.mode};
    }
  } catch (const std::exception& e) {
    fmt::print(stderr, "registration_bench: {}\n", e.what());
    return 1;
  }
  return 0;
}
