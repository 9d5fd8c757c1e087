// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/registration/closure_finder.hpp"

#include <algorithm>

namespace maplet {

namespace {

constexpr std::uint32_t kNeighbours = 3;  // ids apart: nearer ones share keyframes or views
constexpr double kMetresPerRadian = 1.5;  // a turned view shares as little as a distant one
constexpr double kFrontier_m = 0.5;       // so much nearer a maplet counts at whose border one is
constexpr double kDrift_m = 0.04;         // a maplet, of what the skeleton's guess may be off
constexpr double kDrift_rad = 0.01;

}  // namespace

ClosureFinder::ClosureFinder(const RegistrationConfig& config, Arena& arena)
    : config_{config}, verifier_{arena.make<Verifier>("registration/verifier", config)} {}

ClosureFinder::Candidates ClosureFinder::nearest(const Maplet& newest,
                                                 const PlacePrior& prior) const noexcept {
  Candidates best;
  for (int i = 0; i < prior.count(); ++i) {
    const MapletKey key = prior.key(i);
    if (key.agent != newest.key.agent || key.epoch != newest.key.epoch) continue;
    if (key.id + kNeighbours > newest.key.id && !prior.apart(i, newest.key)) continue;
    Candidate c{i, 0.0, {}};
    if (!prior.relate(i, newest.key, c.T_a_b)) continue;
    const double distance_m = c.T_a_b.se3.t.norm();
    if (distance_m > config_.search_m) continue;
    c.cost = distance_m + kMetresPerRadian * c.T_a_b.se3.angle();
    const RegionOfInterest* frontier = prior.frontier(i);
    if (frontier != nullptr && frontier->contains(c.T_a_b.se3.t)) c.cost -= kFrontier_m;
    if (full(best)) {
      if (best.back().cost <= c.cost) continue;
      best.pop_back();
    }
    const auto place =
        std::upper_bound(best.begin(), best.end(), c,
                         [](const Candidate& x, const Candidate& y) { return x.cost < y.cost; });
    best.insert(place, c);
  }
  return best;
}

ClosureFinder::Closures ClosureFinder::run(const Maplet& newest, PlacePrior& prior,
                                           Deadline deadline) noexcept {
  Closures out;
  ++counts_.searched;
  for (const Candidate& c : nearest(newest, prior)) {
    if (deadline.expired()) break;
    const Maplet* older = prior.load(c.index);
    if (older == nullptr) continue;
    ++counts_.tried;
    verifier_->look_first_at(prior.frontier(c.index));
    const double apart = newest.key.id - older->key.id;
    const Closure found = verifier_->verify(
        *older, newest, c.T_a_b, std::min(config_.gate_m, config_.link_gate_m + kDrift_m * apart),
        std::min(config_.gate_rad, config_.link_gate_rad + kDrift_rad * apart), Prior::kPath,
        deadline);
    if (found.judgement.verdict != Verdict::kAccept) {
      ++(found.judgement.verdict == Verdict::kReject ? counts_.rejected : counts_.undecided);
      continue;
    }
    ++counts_.accepted;
    out.push_back(closure_of(older->key, older->stamp, newest.key, newest.stamp, found.alignment));
  }
  return out;
}

}  // namespace maplet
