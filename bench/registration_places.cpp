// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Places found without a guess: verdicts against the truth, and what a search costs.
#include <fmt/core.h>

#include <Eigen/Cholesky>
#include <fstream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "bench/registration_modes.hpp"
#include "bench/timing.hpp"
#include "core/registration/place_index.hpp"

namespace maplet::bench {

void report_judge(const Options& options, const Runs& runs) {
  if (runs.size() != 2) throw std::runtime_error{"judge takes two runs"};
  std::map<std::pair<std::string, std::string>, nlohmann::json> lines;
  std::ifstream in{options.lines};
  if (!in) throw std::runtime_error{"cannot read --lines " + options.lines};
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

void report_search(const Options& options, const Runs& runs) {
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
      (void)index.query(*m.maplet, {}, Deadline::never());
      us.push_back(cpu_us() - before);
    }
  }
  fmt::print("{} stored, {:.0f} bytes each: query cpu p50 {:.2f} ms p99 {:.2f} ms max {:.2f} ms\n",
             index.size(), static_cast<double>(sizeof(PlaceDescriptor)), 1e-3 * percentile(us, 0.5),
             1e-3 * percentile(us, 0.99), 1e-3 * percentile(us, 1.0));
}

}  // namespace maplet::bench
