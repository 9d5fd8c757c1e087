// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>
#include <time.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "core/maplet/shared_keyframe.hpp"
#include "core/registration/place_index.hpp"
#include "core/registration/place_verifier.hpp"
#include "core/registration/verdict.hpp"
#include "tools/files/maplet_file.hpp"
#include "tools/mapletctl/command.hpp"
#include "tools/mapletctl/planar_option.hpp"

namespace maplet::ctl {
namespace {

using Json = nlohmann::ordered_json;

struct Options {
  std::string a, b;
  std::vector<double> guess;
  double budget_us = 0.0;
  bool planar = false;
  bool json = false;
};

double cpu_us() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) * 1e6 + static_cast<double>(t.tv_nsec) * 1e-3;
}

Se3 parse_guess(const std::vector<double>& g) {
  Se3 T{Eigen::Quaterniond{g[6], g[3], g[4], g[5]}, {g[0], g[1], g[2]}};
  if (!(std::abs(T.q.norm() - 1.0) < 0.01) || !T.t.allFinite()) {
    throw Failure{"--guess: x,y,z,qx,qy,qz,qw needs finite numbers and a unit quaternion", 2};
  }
  T.q.normalize();
  return T;
}

Json vector_json(const double* values, int count) {
  Json out = Json::array();
  for (int i = 0; i < count; ++i) out.push_back(values[i]);
  return out;
}

Json to_json(const Closure& c, double us, double verdict_us) {
  Json out{{"verdict", to_string(c.judgement.verdict)}, {"reason", c.judgement.reason}};
  const Se3& T = c.alignment.T_a_b.se3;
  if (c.aligned) {
    out["T_a_b"] = {T.t.x(), T.t.y(), T.t.z(), T.q.x(), T.q.y(), T.q.z(), T.q.w()};
    out["covariance"] = vector_json(c.alignment.covariance.data(), 36);  // symmetric
    if (c.alignment.plane != PlaneCode::kSpace) out["planar"] = planar_json(c.alignment);
    out["free_axes"] = Json::array();
    for (const Vector6d& axis : c.alignment.free_axes) {
      out["free_axes"].push_back(vector_json(axis.data(), 6));
    }
  } else {
    out["T_a_b"] = nullptr;
    out["covariance"] = nullptr;
    out["free_axes"] = Json::array();  // all: nothing fixes any
    for (int k = 0; k < 6; ++k) {
      const Vector6d axis = Vector6d::Unit(k);
      out["free_axes"].push_back(vector_json(axis.data(), 6));
    }
  }
  out["matches"] = c.alignment.matches;
  out["overlap"] = c.alignment.overlap;
  out["iterations"] = c.alignment.iterations;
  out["stop"] = to_string(c.alignment.stop);
  out["us"] = us;
  out["verdict_us"] = verdict_us;
  out["chi2_per_dof"] = c.alignment.chi2_per_dof;
  out["conflict"] = c.conflict;
  return out;
}

void print_table(const Closure& c, double us, double verdict_us) {
  fmt::print("{}: {}\n", to_string(c.judgement.verdict), c.judgement.reason);
  if (!c.aligned) return;
  const Se3& T = c.alignment.T_a_b.se3;
  const Vector6d sigma = c.alignment.covariance.diagonal().cwiseSqrt();
  fmt::print("T_a_b     {:.4f} {:.4f} {:.4f} m, turned by {:.3f} deg\n", T.t.x(), T.t.y(), T.t.z(),
             T.angle() * 57.29577951308232);
  fmt::print("sigma     {:.1f} {:.1f} {:.1f} mm, {:.2f} {:.2f} {:.2f} mrad, {} axes free\n",
             sigma[0] * 1e3, sigma[1] * 1e3, sigma[2] * 1e3, sigma[3] * 1e3, sigma[4] * 1e3,
             sigma[5] * 1e3, c.alignment.free_axes.size());
  fmt::print("planes    {} pairs on {:.0f} % of the smaller area, chi2/dof {:.2f}\n",
             c.alignment.matches, 100.0 * c.alignment.overlap, c.alignment.chi2_per_dof);
  fmt::print("stopped   {} after {} iterations, {:.0f} us; the verdict took {:.0f} us\n",
             to_string(c.alignment.stop), c.alignment.iterations, us, verdict_us);
}

// Two maplets alone: no path says how others lie to them.
class NoPaths final : public PlaceRelations {
 public:
  [[nodiscard]] bool relate(const MapletKey&, const MapletKey&, Se3&) const noexcept override {
    return false;
  }
};

constexpr Judgement kAlike{
    Verdict::kUndecided,
    "the planes agree; two maplets alone do not tell it from a place that is alike"};

// The two origins may be near each other; if not, every place that the planes suggest is tried.
Closure search(Maplet& a, Maplet& b, const RegistrationConfig& config,
               const std::optional<PlanarMotion>& planar, Verifier& verifier, Deadline deadline) {
  Closure out = verifier.verify(a, b, {}, config.gate_m, config.gate_rad, Prior::kGuess, deadline);
  if (out.judgement.verdict == Verdict::kAccept) {
    out.judgement = kAlike;
    return out;
  }
  a.key = {1, 0, 0};  // two runs may be of one agent
  b.key = {2, 0, 0};
  Arena arena;
  PlaceIndex index{1, arena};
  index.add(a);
  PlaceVerifier places{config, PlaceVerifier::kPerPair, arena};
  if (planar) places.hold_to(*planar);
  bool in_time = true;
  for (const PlaceCandidate& c : index.query(b, {}, deadline)) {
    in_time = places.add(a, b, c.guesses, deadline) != Stop::kDeadline;
  }
  in_time = in_time && index.stop() != Stop::kDeadline;
  places.judge(NoPaths{});
  const auto found = places.hypotheses();
  const auto best = std::ranges::max_element(found, {}, &PlaceHypothesis::value);
  if (best != found.end()) {
    out = {best->judgement, true, best->alignment, best->evidence.contradiction()};
    if (out.judgement.verdict == Verdict::kAccept) out.judgement = kAlike;
  }
  if (!in_time) {
    out.judgement = {Verdict::kUndecided, "no time left"};
    out.alignment.stop = Stop::kDeadline;
  }
  return out;
}

void run(const Options& options) {
  const auto a = files::read_maplet(options.a);
  const auto b = files::read_maplet(options.b);
  const RegistrationConfig config;
  Se3 guess;
  const bool guessed = !options.guess.empty();
  if (guessed) guess = parse_guess(options.guess);
  const auto of_path = guessed ? std::nullopt : shared_keyframe(*a, *b);
  const bool linked = of_path.has_value();
  if (linked) guess = *of_path;
  const double gate_m = linked ? config.link_gate_m : config.gate_m;
  const double gate_rad = linked ? config.link_gate_rad : config.gate_rad;
  const MonotonicClock clock;
  const auto verifier = std::make_unique<Verifier>(config);
  std::optional<PlanarMotion> planar;
  if (options.planar) {
    verifier->hold_to(planar.emplace(plane_of(*a, options.a)));
    check_one_plane(*planar, *b, options.b);
  }
  const double before = cpu_us();
  const Deadline deadline =
      options.budget_us > 0.0
          ? Deadline{clock, Duration{static_cast<std::int64_t>(options.budget_us * 1e3)}}
          : Deadline::never();
  Closure closure;
  double us = 0.0;
  if (guessed || linked) {
    closure =
        verifier->align(*a, *b, Transform<MapletA, MapletB>{guess}, gate_m, gate_rad, deadline);
    us = cpu_us() - before;
    verifier->judge(*a, *b, closure, gate_m, gate_rad, linked ? Prior::kPath : Prior::kGuess,
                    deadline);
  } else {
    closure = search(*a, *b, config, planar, *verifier, deadline);
    us = cpu_us() - before;
  }
  const double verdict_us = cpu_us() - before - us;
  if (options.json) {
    fmt::print("{}\n", to_json(closure, us, verdict_us).dump());
  } else {
    print_table(closure, us, verdict_us);
  }
}

}  // namespace

void add_register(Command app) {
  auto options = std::make_shared<Options>();
  const Command command =
      app.add_command("register", "Aligns two maplets by their planes and says how sure that is");
  command.add_option("a", options->a, "NNNN.maplet").required().type_name("A");
  command.add_option("b", options->b, "NNNN.maplet").required().type_name("B");
  command
      .add_option("--guess", options->guess,
                  "T_a_b = x,y,z,qx,qy,qz,qw, within 0.6 m and 20 deg; default: a keyframe that "
                  "both hold; else every place that the planes suggest is tried, and the best one "
                  "is undecided: match asks all maplets of two runs")
      .comma_list(7)
      .type_name("POSE");
  command.add_option("--budget-us", options->budget_us, "Stop after this time; 0 = when done")
      .range(0.0, 1e9);
  command.add_flag("--planar", options->planar, kPlanarHelp);
  command.add_flag("--json", options->json, "One line of JSON");
  command.footer(
      "Examples:\n"
      "  mapletctl register out/run/maplets/0003.maplet out/run/maplets/0004.maplet\n"
      "  mapletctl register A.maplet B.maplet --guess 0.3,0,0.1,0,0,0,1 --budget-us 200 --json");
  command.run([options] { run(*options); });
}

}  // namespace maplet::ctl
