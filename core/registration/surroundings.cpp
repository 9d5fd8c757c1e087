// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/registration/surroundings.hpp"

#include <algorithm>

namespace maplet {

namespace {

constexpr double kLimit = 0.05;  // of what was looked for; of one place it is .02
constexpr double kChance = 0.5;  // m: one plane's edge

bool too_much(double agreed, double contradicted) noexcept {
  return contradicted > kChance + kLimit * (agreed + contradicted);
}

// Keeps a list in order, its last ones fall off.
template <class List, class Item>
void insert(const Item& item, double Item::*by, List& list) noexcept {
  if (full(list)) {
    if (!(item.*by < list.back().*by)) return;
    list.resize(list.size() - 1);
  }
  list.push_back(item);
  for (std::size_t i = list.size() - 1; i > 0 && list[i].*by < list[i - 1].*by; --i)
    std::swap(list[i], list[i - 1]);
}

}  // namespace

void Surroundings::begin(const MapletKey& a, const MapletKey& b, const Se3& T_a_b) noexcept {
  *this = {};
  T_a_b_ = T_a_b;
  beside_a_.push_back({a, Se3{}, 0.0});
  beside_b_.push_back({b, Se3{}, 0.0});
}

void Surroundings::put(const MapletKey& key, const Se3& T, Besides& besides) noexcept {
  const Beside beside{key, T, T.t.norm()};
  if (beside.path_m < kReach_m) insert(beside, &Beside::path_m, besides);
}

void Surroundings::put_beside_a(const MapletKey& key, const Se3& T_a_key) noexcept {
  put(key, T_a_key, beside_a_);
}

void Surroundings::put_beside_b(const MapletKey& key, const Se3& T_b_key) noexcept {
  put(key, T_b_key, beside_b_);
}

void Surroundings::pair_up() noexcept {
  paired_ = true;
  for (const Beside& a : beside_a_) {
    for (const Beside& b : beside_b_) {
      if (&a == &beside_a_.front() && &b == &beside_b_.front()) continue;
      const double path_m = a.path_m + b.path_m;
      if (path_m > kReach_m) continue;
      const double apart_m = path_m + a.T_place_key.angle() + b.T_place_key.angle();
      insert(Pair{a.key, b.key, a.T_place_key.inverse() * T_a_b_ * b.T_place_key, apart_m},
             &Pair::apart_m, pairs_);
    }
  }
}

const Surroundings::Pair* Surroundings::next() noexcept {
  if (!paired_) pair_up();
  return next_ < pairs_.size() ? &pairs_[next_++] : nullptr;
}

void Surroundings::weigh(const Evidence& evidence) noexcept {
  if (!evidence.complete) return;
  agreed_ += evidence.agreed;
  contradicted_ += evidence.contradicted;
}

bool Surroundings::contradict() const noexcept { return too_much(agreed_, contradicted_); }

bool Surroundings::contradicts(const Evidence& evidence) noexcept {
  return too_much(evidence.agreed, evidence.contradicted);
}

}  // namespace maplet
