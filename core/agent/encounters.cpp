// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/agent/encounters.hpp"

#include <algorithm>

#include "core/maplet/codec.hpp"

namespace maplet {

namespace {

constexpr double kSame_m = 0.5;  // two pairs that vouch for each other, drift between them included
constexpr double kSame_rad = 0.1;
constexpr double kContradiction_m = 1.0;  // from what the skeleton says already
constexpr double kContradiction_rad = 0.3;
constexpr int kTried = 6;  // candidates of one maplet that are verified, of each agent

/// As the skeleton has it, of maplets in one group, those that it has no room for included.
class SkeletonRelations final : public PlaceRelations {
 public:
  explicit SkeletonRelations(const Skeleton& skeleton) noexcept : skeleton_{skeleton} {}
  [[nodiscard]] bool relate(const MapletKey& x, const MapletKey& y,
                            Se3& T_x_y) const noexcept override {
    const auto at_x = skeleton_.standing(x);
    const auto at_y = skeleton_.standing(y);
    if (!at_x || !at_y || at_x->gauge != at_y->gauge) return false;
    T_x_y = at_x->T_world_maplet.inverse() * at_y->T_world_maplet;
    return true;
  }

 private:
  const Skeleton& skeleton_;
};

/// Whether another pair, of two other maplets of the same two agents, puts the agents to each other
/// as h does. Neighbours of one maplet see the same wrong place as it does: they do not count.
bool says_the_same(const PlaceHypothesis& h, const PlaceHypothesis& other,
                   const SkeletonRelations& relations) noexcept {
  const bool one_life = h.a.agent == h.b.agent && h.a.epoch == h.b.epoch;  // two parts of it
  Se3 ignored;
  const bool turned = one_life ? !relations.relate(h.a, other.a, ignored)
                               : other.a.agent == h.b.agent && other.a.epoch == h.b.epoch;
  const MapletKey& a = turned ? other.b : other.a;
  const MapletKey& b = turned ? other.a : other.b;
  Se3 T_a_b = other.alignment.T_a_b.se3;
  if (turned) T_a_b = T_a_b.inverse();
  Se3 T_ha_a;
  Se3 T_b_hb;
  if (a == h.a || b == h.b || !relations.relate(h.a, a, T_ha_a) ||
      !relations.relate(b, h.b, T_b_hb)) {
    return false;
  }
  const Se3 apart = h.alignment.T_a_b.se3.inverse() * (T_ha_a * T_a_b * T_b_hb);
  return apart.t.norm() < kSame_m && apart.angle() < kSame_rad;
}

// The other place that a maplet fits must not be crowded out by those of a third agent.
void keep_best_of_each(PlaceIndex::Candidates& ranked) noexcept {
  PlaceIndex::Candidates kept;
  for (const PlaceCandidate& c : ranked) {
    const auto of_it = std::ranges::count(
        kept, c.key.agent, [](const PlaceCandidate& other) { return other.key.agent; });
    if (of_it < kTried) kept.push_back(c);
  }
  ranked = kept;
}

bool is_own(const MapletKey& key, const MapletKey& self) noexcept {
  return key.agent == self.agent && key.epoch == self.epoch;
}

}  // namespace

Encounters::Encounters(const RegistrationConfig& config, const Capacity& capacity, Arena& arena)
    : foreign_{capacity.foreign,      capacity.expected_bytes, capacity.maplet_bytes, arena,
               "agent/foreign slots", "agent/foreign maplets"},
      index_{capacity.own + capacity.foreign, arena},
      verifier_{config, kHypotheses, arena},
      a_{arena.make<Maplet>("agent/a place")},
      b_{arena.make<Maplet>("agent/another place")} {}

void Encounters::wait(const MapletKey& key) noexcept {
  if (waiting_count_ == kWaiting) {  // the oldest was in view longest
    waiting_first_ = (waiting_first_ + 1) % kWaiting;
    --waiting_count_;
  }
  waiting_[(waiting_first_ + waiting_count_++) % kWaiting] = key;
}

bool Encounters::hear(const MapletKey& key, std::span<const std::byte> bytes) noexcept {
  if (foreign_.find(key) || !decode(bytes, *a_) || a_->key != key) return false;
  if (!foreign_.put(key, bytes)) return false;
  index_.add(*a_);
  wait(key);
  return true;
}

void Encounters::add_own(const Maplet& maplet) noexcept {
  index_.add(maplet);
  if (foreign_.count() > 0 || part_ > 0) wait(maplet.key);
}

bool Encounters::load(const MapletKey& key, const MapletStore& own, const MapletKey& self,
                      Maplet& out) const noexcept {
  const auto bytes = is_own(key, self) ? own.find(key) : foreign_.find(key);
  return bytes && decode(*bytes, out) && out.key == key;
}

Encounters::Found Encounters::work(const Skeleton& skeleton, const MapletStore& own, MapletKey self,
                                   Deadline deadline) noexcept {
  if (!busy() || deadline.expired()) return {};
  if (recalled_ < restored_) {
    recall(own);
    return {};
  }
  if (!asking_) {
    ask(own, self, deadline);
    return {};
  }
  if (next_candidate_ < candidates_.size()) {
    verify(own, self, deadline);
    return {};
  }
  if (looking_) {
    look(own, self, deadline);
    return {};
  }
  return judge(skeleton, own, self);
}

void Encounters::recall(const MapletStore& own) noexcept {
  const MapletKey* key = own.nth(recalled_++);
  if (key != nullptr && decode(*own.find(*key), *a_)) index_.add(*a_);
}

void Encounters::ask(const MapletStore& own, const MapletKey& self, Deadline deadline) noexcept {
  const MapletKey key = asked_ = waiting_[waiting_first_];
  const bool loaded = load(key, own, self, *b_);
  if (loaded) {
    // Of ourselves only what is not of this path: earlier parts, earlier lives.
    PlaceSkip skip{key.agent};
    if (key.agent == self.agent)
      skip = {key.agent, false, key.epoch, is_own(key, self) ? part_ : 0};
    candidates_ = index_.query(*b_, skip, deadline);
    if (index_.stop() == Stop::kDeadline && ++cuts_ < kMostCuts) return;
  }
  cuts_ = 0;
  waiting_first_ = (waiting_first_ + 1) % kWaiting;
  --waiting_count_;
  if (!loaded) return;
  if (!is_own(key, self)) ++counts_of(key.agent).maplets;
  keep_best_of_each(candidates_);
  next_candidate_ = next_guess_ = 0;
  asking_ = true;
}

void Encounters::verify(const MapletStore& own, const MapletKey& self, Deadline deadline) noexcept {
  const PlaceCandidate& candidate = candidates_[next_candidate_];
  if (!load(candidate.key, own, self, *a_)) return next_candidate();
  if (next_guess_ == 0 && cuts_ == 0) {
    if (verifier_.hypotheses().size() + PlaceVerifier::kPerPair > kHypotheses) {
      verifier_.clear();
      told_.clear();
    }
    const bool own_mission = is_own(a_->key, self) && is_own(b_->key, self);
    verifier_.hold_to(own_mission ? planar_ : std::nullopt);
    if (!verifier_.begin_pair()) return next_candidate();
  }
  for (; next_guess_ < candidate.guesses.size(); ++next_guess_) {
    if (deadline.expired()) return;
    const bool last = cuts_ + 1 >= kMostCuts;
    if (!verifier_.try_guess(*a_, *b_, candidate.guesses[next_guess_], deadline, last)) {
      ++cuts_;
      if (!last) return;
      in_time_ = false;
    }
    cuts_ = 0;
  }
  verifier_.end_pair(in_time_);
  next_candidate();
}

void Encounters::next_candidate() noexcept {
  ++next_candidate_;
  next_guess_ = 0;
  cuts_ = 0;
  in_time_ = true;
}

// Not before what lies around all that would be told has been looked at.
Encounters::Found Encounters::judge(const Skeleton& skeleton, const MapletStore& own,
                                    const MapletKey& self) noexcept {
  verifier_.judge(SkeletonRelations{skeleton});
  const auto all = verifier_.hypotheses();
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (!unlooked(all[i], skeleton)) continue;
    looking_ = i;
    begin_look(all[i], skeleton, own, self);
    return {};
  }
  asking_ = false;
  return report(skeleton, self);
}

Encounters::Found Encounters::report(const Skeleton& skeleton, const MapletKey& self) noexcept {
  Found found;
  const auto all = verifier_.hypotheses();
  for (std::size_t i = 0; i < all.size(); ++i) {
    const PlaceHypothesis& h = all[i];
    const bool fresh = h.b == asked_ || h.a == asked_;
    if (fresh) {
      EncounterCounts& counts = counts_of(is_own(h.a, self) ? h.b.agent : h.a.agent);
      ++counts.pairs;
      counts.best_overlap = std::max(counts.best_overlap, h.alignment.overlap);
      counts.reason = h.judgement.reason;
    }
    // One closure a pair of maplets, and later ones may vouch for earlier ones.
    if (!full(found) && worth_telling(h, skeleton)) tell(i, false, self, found);
  }
  tell_rivals(skeleton, self, found);
  return found;
}

void Encounters::tell(std::size_t hypothesis, bool answered, const MapletKey& self,
                      Found& found) noexcept {
  const PlaceHypothesis& h = verifier_.hypotheses()[hypothesis];
  told_.push_back({hypothesis, answered});
  if (!answered) ++counts_of(is_own(h.a, self) ? h.b.agent : h.a.agent).accepted;
  found.push_back(closure_of(h.a, h.stamp_a, h.b, h.stamp_b, h.alignment));
}

void Encounters::tell_rivals(const Skeleton& skeleton, const MapletKey& self,
                             Found& found) noexcept {
  const SkeletonRelations relations{skeleton};
  const auto all = verifier_.hypotheses();
  for (std::size_t k = 0; k < told_.size(); ++k) {
    const PlaceHypothesis& h = all[told_[k].hypothesis];
    if (told_[k].answered || h.judgement.verdict == Verdict::kAccept) continue;
    const PlaceHypothesis* likeliest = nullptr;
    for (const PlaceHypothesis& other : all) {
      if (likeliest != nullptr && other.support <= likeliest->support) continue;
      if (verifier_.rivals(h, other, relations) && !told(other) &&
          !linked(skeleton, other.a, other.b))
        likeliest = &other;
    }
    if (likeliest == nullptr) continue;
    if (full(found)) return;
    told_[k].answered = true;
    tell(static_cast<std::size_t>(likeliest - all.data()), true, self, found);
  }
}

bool Encounters::told(const PlaceHypothesis& h) const noexcept {
  return std::ranges::any_of(told_, [&](const Told& t) {
    const PlaceHypothesis& other = verifier_.hypotheses()[t.hypothesis];
    return other.a == h.a && other.b == h.b;
  });
}

bool Encounters::worth_telling(const PlaceHypothesis& h, const Skeleton& skeleton) const noexcept {
  return h.judgement.verdict == Verdict::kAccept && !told(h) && trusted(h, skeleton) &&
         !linked(skeleton, h.a, h.b);
}

// Where the skeleton relates the two already, it is what must not be contradicted.
bool Encounters::unlooked(const PlaceHypothesis& h, const Skeleton& skeleton) const noexcept {
  Se3 ignored;
  return h.around == PlaceHypothesis::Around::kUnknown && worth_telling(h, skeleton) &&
         !SkeletonRelations{skeleton}.relate(h.a, h.b, ignored);
}

void Encounters::begin_look(const PlaceHypothesis& h, const Skeleton& skeleton,
                            const MapletStore& own, const MapletKey& self) noexcept {
  const SkeletonRelations relations{skeleton};
  around_.begin(h.a, h.b, h.alignment.T_a_b.se3);
  const auto put_all = [&](const MapletStore& store) {
    for (std::uint64_t n = store.forgotten(); n < store.count(); ++n) {
      const MapletKey* key = store.nth(n);
      Se3 T;
      if (key == nullptr || *key == h.a || *key == h.b) continue;
      if (key->agent == h.a.agent && relations.relate(h.a, *key, T)) {
        around_.put_beside_a(*key, T);
      } else if (key->agent == h.b.agent && relations.relate(h.b, *key, T)) {
        around_.put_beside_b(*key, T);
      }
    }
  };
  put_all(own);
  if (!is_own(h.a, self) || !is_own(h.b, self)) put_all(foreign_);
}

void Encounters::look(const MapletStore& own, const MapletKey& self, Deadline deadline) noexcept {
  const Surroundings::Pair* pair = around_.next();
  if (pair == nullptr) {
    verifier_.note_around(*looking_, around_.contradict());
    looking_.reset();
    return;
  }
  if (!load(pair->a, own, self, *a_) || !load(pair->b, own, self, *b_)) return;
  verifier_.hold_to(std::nullopt);
  around_.weigh(verifier_.weigh_around(*a_, *b_, *pair, deadline));
}

bool Encounters::trusted(const PlaceHypothesis& h, const Skeleton& skeleton) const noexcept {
  const SkeletonRelations relations{skeleton};
  Se3 T_a_b;
  if (relations.relate(h.a, h.b, T_a_b)) {
    const Se3 apart = T_a_b.inverse() * h.alignment.T_a_b.se3;
    return apart.t.norm() < kContradiction_m && apart.angle() < kContradiction_rad;
  }
  return std::ranges::any_of(verifier_.hypotheses(), [&](const PlaceHypothesis& other) {
    return other.judgement.verdict == Verdict::kAccept && says_the_same(h, other, relations);
  });
}

bool Encounters::linked(const Skeleton& skeleton, const MapletKey& a,
                        const MapletKey& b) const noexcept {
  for (int i = 0; i < skeleton.factor_count(); ++i) {
    const Skeleton::FactorView factor = skeleton.factor(i);
    if ((factor.a == a && factor.b == b) || (factor.a == b && factor.b == a)) return true;
  }
  return false;
}

EncounterCounts& Encounters::counts_of(std::uint16_t agent) noexcept {
  for (EncounterCounts& counts : counts_) {
    if (counts.agent == agent) return counts;
  }
  if (full(counts_)) counts_.erase(counts_.begin());
  counts_.emplace_back();
  counts_.back().agent = agent;
  return counts_.back();
}

}  // namespace maplet
