// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The estimate that depends on the set of records alone: docs/math/skeleton.md, section 11.
#include <algorithm>
#include <tuple>

#include "core/skeleton/skeleton.hpp"

namespace maplet {

namespace {
constexpr int kMostReviews = 30;
constexpr int kUnheard =
    16;  // so many closures that are in, for one that the next does not know of
constexpr double kStep = 1e-9;  // m, rad

// Whether so many closures that agree leave it open which of both is true: three times as many
// decide, a lone one is just wrong beside three.
bool open_between(int set, int rival) noexcept {
  return rival >= 2 ? 3 * rival >= set : rival == 1 && set <= 2;
}
}  // namespace

void Skeleton::sort_by_key() noexcept {
  std::copy_n(factors_.begin(), factor_count_, order_.begin());
  const auto key = [&](int factor) {
    const Factor<SpatialSpace>& f = solver_.graph().factor(factor);
    const Provenance& p = provenance_[factor];
    return std::tuple{p.kind, keys_[f.a], keys_[f.b], p.stamp_a, p.stamp_b, f.z.t.x(), f.z.t.y()};
  };
  std::sort(order_.begin(), order_.begin() + factor_count_,
            [&](int x, int y) { return key(x) < key(y); });
}

// Every group from its gauge on, along odometry, in the order of the keys.
void Skeleton::start_canonically() noexcept {
  auto& graph = solver_.graph();
  chains_.clear();  // links may have come in any order: a later one first begins a chain of its own
  for (int k = 0; k < factor_count_; ++k) {
    const Factor<SpatialSpace>& f = graph.factor(order_[k]);
    if (provenance_[order_[k]].kind == DeltaPose::Kind::kConsecutive)
      chains_.append(f.a, f.b, {f.z, unpack<SpatialSpace>(f.information).inverse()});
  }
  std::fill(placed_.begin(), placed_.end(), false);
  for (int i = 0; i < graph.node_end(); ++i) {
    if (!graph.node(i).used || graph.node(i).group != i) continue;
    placed_[i] = true;
    graph.node(i).pose = Se3{};
  }
  for (bool more = true; more;) {
    more = false;
    for (int k = 0; k < factor_count_; ++k) {
      const Factor<SpatialSpace>& f = graph.factor(order_[k]);
      if (!f.state.active || placed_[f.a] == placed_[f.b]) continue;
      if (placed_[f.a]) {
        graph.node(f.b).pose = graph.node(f.a).pose * f.z;
      } else {
        graph.node(f.a).pose = graph.node(f.b).pose * f.z.inverse();
      }
      placed_[f.a] = placed_[f.b] = true;
      more = true;
    }
  }
}

// Closures between two agents first stand or fall as a set, unless another set has about as much to
// say: in a symmetric place both do, once all of it has been seen. Then each one by itself, as they
// would have come in the order of their keys. The more are in already, the less one of them tells
// about the next: what is new is eliminated once for a share of them.
void Skeleton::judge_all() noexcept {
  std::fill(late_.begin(), late_.end(), false);
  int closures = 0;
  for (int k = 0; k < factor_count_; ++k) {
    const ClosureState state = judge_.state(order_[k]);
    if (state != ClosureState::kNone && state != ClosureState::kForced)
      order_[closures++] = order_[k];
  }
  const std::span<const int> list = order_.first(static_cast<std::size_t>(closures));
  bool any_torn = false;
  sets_.choose(list, [&](int factor, bool agrees, const auto& sizes) {
    if (open_between(sizes.set, sizes.rival)) {
      judge_.tear(factor);
      any_torn = true;
    } else if (!agrees) {
      judge_.bar(factor);
    }
    late_[factor] =
        sizes.set < 2;  // nothing bears it out: once the others have said what they know
  });
  int unheard = 0;  // accepted since the last elimination
  for (const bool late : {false, true})
    for (const int factor : list) {
      if (judge_.state(factor) == ClosureState::kRejected || late_[factor] != late) continue;
      if (any_torn && torn(factor)) judge_.tear(factor);  // also one that was not compared
      if (unheard > judge_.accepted() / kUnheard) {
        solver_.flush();
        unheard = 0;
      }
      const int before = judge_.accepted();
      judge_.consider(factor);
      unheard += judge_.accepted() - before;
    }
}

bool Skeleton::settle(Deadline deadline) noexcept {
  if (canonical_) return true;
  if (deadline.expired()) return false;
  decide_waiting(Deadline::never());
  solver_.flush();
  sort_by_key();
  judge_.begin_anew(order_.first(static_cast<std::size_t>(factor_count_)));
  solver_.recall_set_aside();
  solver_.order_by_seniority(true);
  start_canonically();
  (void)solver_.optimise(Deadline::never());
  judge_all();
  for (int k = 0; k < kMostReviews; ++k) {
    report_ = solver_.optimise(Deadline::never());
    if (!judge_.review() || deadline.expired()) break;
    solver_.flush();
  }
  canonical_ = !deadline.expired() && solver_.polish(kStep);
  solver_.order_by_seniority(false);
  report_.chi2 = solver_.chi2();
  return canonical_;
}

}  // namespace maplet
