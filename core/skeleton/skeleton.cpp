// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/skeleton/skeleton.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <bit>

namespace maplet {

namespace {

constexpr std::array kTable = {
    Field<SkeletonConfig>{"max_nodes", &SkeletonConfig::max_nodes, 2, 1e6,
                          "Maplets the skeleton holds, of all agents"},
    Field<SkeletonConfig>{"max_factors", &SkeletonConfig::max_factors, 1, 1e7,
                          "Delta-poses the skeleton holds, of all agents"},
    Field<SkeletonConfig>{"blocks_per_node", &SkeletonConfig::blocks_per_node, 4, 1000,
                          "Blocks of the Cholesky factor for each node, on the average"},
    Field<SkeletonConfig>{
        "closure_sigmas", &SkeletonConfig::closure_sigmas, 1.0, 100.0,
        "Standard deviations are taken this much larger when a closure is judged"},
    Field<SkeletonConfig>{"condense", &SkeletonConfig::condense, 0, 1,
                          "Take the least informative maplets out at the limits; else stop there"},
};

constexpr int kForwards = 2;  // maplets taken out that are remembered, a node

// Information of a delta-pose. @return false when there is none
bool invert(const Matrix6d& covariance, Matrix6d& information) noexcept {
  if (!covariance.allFinite()) return false;
  const Eigen::LLT<Matrix6d> llt{covariance};
  if (llt.info() != Eigen::Success) return false;
  information = llt.solve(Matrix6d::Identity());
  return information.allFinite();
}

// A record's content in one number. Numbers of a set add up to the same in whatever order.
std::uint64_t digest_of(const DeltaPose& d) noexcept {
  std::uint64_t h = 0;
  const auto mix = [&](std::uint64_t v) { h = hash_of(h ^ (v + 0x9E3779B97F4A7C15u)); };
  const auto real = [&](double v) { mix(std::bit_cast<std::uint64_t>(v)); };
  for (const MapletKey& k : {d.a, d.b}) mix(hash_of(k));
  mix(static_cast<std::uint64_t>(d.kind));
  for (const Stamp& s : {d.stamp_a, d.stamp_b}) mix(static_cast<std::uint64_t>(s.count()));
  for (int i = 0; i < 3; ++i) real(d.T_a_b.se3.t[i]);
  for (int i = 0; i < 4; ++i) real(d.T_a_b.se3.q.coeffs()[i]);
  for (int r = 0; r < 6; ++r)
    for (int c = 0; c <= r; ++c) real(d.covariance(r, c));
  return h;
}

}  // namespace

std::uint64_t hash_of(const MapletKey& key) noexcept {
  return hash_of(((std::uint64_t{key.epoch} << 32) | key.id) ^
                 (std::uint64_t{key.agent} * 0x9E3779B97F4A7C15u));
}

const std::span<const Field<SkeletonConfig>> SkeletonConfig::kFields{kTable};

Skeleton::Skeleton(const SkeletonConfig& config, Arena& arena)
    : config_{config},
      solver_{{config.max_nodes, config.max_factors, config.max_nodes * config.blocks_per_node},
              arena,
              {.defer_share = 0.05}},  // small graphs, and robots steer by them: let little wait
      judge_{solver_, arena, {.inflation = config.closure_sigmas, .wants_support = false}},
      finder_{solver_, arena},
      condenser_{solver_, judge_.marginals(), arena},
      forwarding_{config.condense ? kForwards * config.max_nodes : 0, arena},
      paths_{config.max_nodes, arena},
      chains_{config.max_nodes, arena},
      sets_{solver_.graph(), chains_, kMostCompared, arena},
      keys_{arena.make_array<MapletKey>(config.max_nodes, "skeleton/keys")},
      provenance_{arena.make_array<Provenance>(config.max_factors, "skeleton/keys")},
      table_{arena.make_array<int>(std::bit_ceil(2 * static_cast<std::size_t>(config.max_nodes)),
                                   "skeleton/keys")},
      nodes_{arena.make_array<int>(config.max_nodes, "skeleton/keys")},
      factors_{arena.make_array<int>(config.max_factors, "skeleton/keys")},
      order_{
          arena.make_array<int>(std::max(config.max_factors, config.max_nodes), "skeleton/keys")},
      placed_{arena.make_array<bool>(config.max_nodes, "skeleton/keys")},
      late_{arena.make_array<bool>(config.max_factors, "skeleton/keys")} {}

std::size_t Skeleton::bucket(const MapletKey& key, bool point) const noexcept {
  return static_cast<std::size_t>(hash_of(hash_of(key) + (point ? 1 : 0))) & (table_.size() - 1);
}

int Skeleton::find(const MapletKey& key, bool point) const noexcept {
  for (std::size_t i = bucket(key, point);; i = (i + 1) & (table_.size() - 1)) {
    if (table_[i] == 0) return -1;
    const int node = table_[i] - 1;
    if (keys_[node] == key && solver_.graph().node(node).point == point) return node;
  }
}

void Skeleton::enter(const MapletKey& key, int node) noexcept {
  std::size_t i = bucket(key, solver_.graph().node(node).point);
  while (table_[i] != 0) i = (i + 1) & (table_.size() - 1);
  table_[i] = node + 1;
}

int Skeleton::insert(const MapletKey& key, const Se3& pose) noexcept {
  const int node = solver_.add_node(pose, {(std::uint64_t{key.agent} << 32) | key.epoch, key.id});
  keys_[node] = key;
  enter(key, node);
  nodes_[node_count_++] = node;
  keep_newest(node);
  return node;
}

// Room is not made at the newest maplet of an agent: its next delta-pose begins there.
void Skeleton::keep_newest(int node) noexcept {
  solver_.graph().node(node).keep = true;
  for (int& other : newest_) {
    if (keys_[other].agent != keys_[node].agent || keys_[other].epoch != keys_[node].epoch)
      continue;
    const bool later = keys_[other].id < keys_[node].id;
    solver_.graph().node(later ? other : node).keep = false;
    if (later) other = node;
    return;
  }
  if (!full(newest_)) newest_.push_back(node);
}

bool Skeleton::known(const DeltaPose& delta, int a, int b) const noexcept {
  bool found = false;
  solver_.graph().for_each_incident(a, [&](int index, int other) {
    const Provenance& p = provenance_[index];
    found |= other == b && solver_.graph().factor(index).a == a && p.record &&
             p.kind == delta.kind && p.stamp_a == delta.stamp_a && p.stamp_b == delta.stamp_b &&
             solver_.graph().factor(index).z.t == delta.T_a_b.se3.t;
  });
  return found;
}

Added Skeleton::add(const MapletKey& key) noexcept {
  if (find(key) >= 0) return Added::kDuplicate;
  if (!make_room(1, 0)) {
    ++counters_.nodes_full;
    return Added::kNodesFull;
  }
  insert(key, Se3{});
  hear_waiting();
  canonical_ = false;
  return Added::kLinked;
}

// The node that stands for a maplet: itself, or the one that it was contracted into.
bool Skeleton::place(const MapletKey& key, Place& out) const noexcept {
  MapletKey hub;
  const auto stands = [&](const MapletKey& k) { return find(k) >= 0; };
  if (!forwarding_.resolve(key, stands, hub, out.from_node)) return false;
  out.node = find(hub);
  return true;
}

void Skeleton::take_factor(int factor, const Provenance& provenance) noexcept {
  provenance_[factor] = provenance;
  factors_[factor_count_++] = factor;
}

Added Skeleton::add(const DeltaPose& delta, Deadline deadline) noexcept {
  Matrix6d information;
  if (delta.a == delta.b || !SpatialSpace::finite(delta.T_a_b.se3) ||
      delta.T_a_b.se3.q.norm() < 0.5 || !invert(delta.covariance, information)) {
    ++counters_.bad_measurements;
    return Added::kBadMeasurement;
  }
  if (delta.kind == DeltaPose::Kind::kConsecutive && loose(delta.covariance)) {
    for (const MapletKey& key : {delta.a, delta.b}) {
      // One that was taken out for want of room does not come back.
      if (forwarding_.find(key) == nullptr && add(key) == Added::kNodesFull)
        return Added::kNodesFull;
    }
    return Added::kLoose;
  }
  int a = find(delta.a);
  int b = find(delta.b);
  if (a >= 0 && b >= 0 && known(delta, a, b)) {
    ++counters_.duplicates;
    return Added::kDuplicate;
  }
  const int nodes = (a < 0 ? 1 : 0) + (b < 0 ? 1 : 0);
  if (!make_room(nodes, 1)) {
    const bool full = solver_.graph().node_count() + nodes > solver_.graph().max_nodes();
    ++(full ? counters_.nodes_full : counters_.factors_full);
    return full ? Added::kNodesFull : Added::kFactorsFull;
  }
  Relation<SpatialSpace> z{delta.T_a_b.se3, delta.covariance};
  z.T.q.normalize();
  // Making room may have taken them out; others may have gone long ago.
  Place at_a{}, at_b{};
  const bool has_a = place(delta.a, at_a);
  const bool has_b = place(delta.b, at_b);
  if ((!has_a && forwarding_.find(delta.a) != nullptr) ||
      (!has_b && forwarding_.find(delta.b) != nullptr) ||
      (has_a && has_b && at_a.node == at_b.node)) {
    ++counters_.gone;
    return Added::kGone;
  }
  if (has_a && keys_[at_a.node] != delta.a) z = at_a.from_node.then(z);
  if (has_b && keys_[at_b.node] != delta.b) z = z.then(at_b.from_node.inverse());
  if (!invert(z.covariance, information)) {
    ++counters_.bad_measurements;
    return Added::kBadMeasurement;
  }
  a = has_a ? at_a.node : insert(delta.a, Se3{});
  b = has_b ? at_b.node : insert(delta.b, Se3{});
  if (has_a && has_b && solver_.group(a) != solver_.group(b)) ++counters_.joined_groups;
  const bool closure = delta.kind == DeltaPose::Kind::kClosure;
  const int factor = solver_.add_between(a, b, z.T, information, closure ? 0.0 : 1.0);
  take_factor(factor, {delta.kind, true, delta.stamp_a, delta.stamp_b});
  digest_ += digest_of(delta);
  canonical_ = false;
  if (closure) {
    if (full(undecided_)) decide_waiting(Deadline::never());
    undecided_.push_back(factor);
  } else {
    chains_.append(a, b, z);
  }
  hear_waiting();
  decide_waiting(deadline);
  report_ = solver_.update(deadline);
  return Added::kLinked;
}

// Whether closures between the same two paths contradict each other, as last settled. One more
// would join the two until they are settled again.
bool Skeleton::torn(int factor) const noexcept {
  const auto own = sets_.pair_of(factor);
  return std::ranges::any_of(judge_.closures(), [&](int other) {
    return judge_.state(other) == ClosureState::kTorn && sets_.pair_of(other) == own;
  });
}

// Closures are judged once everything that came before them is eliminated.
void Skeleton::decide_waiting(Deadline deadline) noexcept {
  if (undecided_.empty() || !solver_.flush(deadline)) return;
  std::size_t done = 0;
  for (; done < undecided_.size() && (done == 0 || !deadline.expired()); ++done) {
    const int factor = undecided_[done];
    if (judge_.state(factor) == ClosureState::kForced) continue;
    if (torn(factor)) judge_.tear(factor);
    judge_.consider(factor);
  }
  undecided_.erase(undecided_.begin(), undecided_.begin() + static_cast<std::ptrdiff_t>(done));
}

SolveReport Skeleton::update(Deadline deadline) noexcept {
  if (!finder_.idle()) (void)finder_.work(deadline);
  decide_waiting(deadline);
  return report_ = solver_.update(deadline);
}

int Skeleton::decide(const MapletKey& a, const MapletKey& b, bool accept,
                     Deadline deadline) noexcept {
  int count = 0;
  for (int k = 0; k < factor_count_; ++k) {
    const FactorView f = factor(k);
    const bool same = (f.a == a && f.b == b) || (f.a == b && f.b == a);
    if (!same || f.kind != DeltaPose::Kind::kClosure) continue;
    judge_.force(factors_[k], accept);
    ++count;
  }
  if (count > 0) {
    canonical_ = false;
    report_ = solver_.update(deadline);
  }
  return count;
}

}  // namespace maplet
