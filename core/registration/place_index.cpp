// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/registration/place_index.hpp"

#include <algorithm>

namespace maplet {

namespace {

// Puts x into a list sorted by falling score, if it is good enough for it.
template <class List, class Item>
void keep_best(List& list, const Item& x) noexcept {
  if (full(list)) {
    if (list.back().score >= x.score) return;
    list.pop_back();
  }
  list.insert(std::upper_bound(list.begin(), list.end(), x,
                               [](const auto& y, const auto& z) { return y.score > z.score; }),
              x);
}

}  // namespace

PlaceIndex::PlaceIndex(std::size_t capacity, Arena& arena)
    : stored_{arena.make_array<PlaceDescriptor>(capacity, "registration/place index")},
      scratch_{arena.make<Scratch>("registration/place search")} {}

void PlaceIndex::add(const Maplet& maplet) noexcept {
  if (stored_.empty()) return;
  const auto known = stored_.first(count_);
  const auto same = std::find_if(known.begin(), known.end(),
                                 [&](const PlaceDescriptor& d) { return d.key == maplet.key; });
  if (same != known.end()) {
    PlaceDescriptor::describe(maplet, *same);
    return;
  }
  if (count_ == stored_.size()) ++forgotten_;
  PlaceDescriptor::describe(maplet, stored_[next_]);
  next_ = (next_ + 1) % stored_.size();
  count_ = std::min(count_ + 1, stored_.size());
}

void PlaceIndex::shortlist(const PlaceSkip& skip, Deadline deadline) noexcept {
  Scratch& s = *scratch_;
  s.shortlist.clear();
  for (std::uint32_t slot = 0; slot < count_; ++slot) {
    const PlaceDescriptor& d = stored_[slot];
    if (d.key == s.asked.key || skip(d.key)) continue;
    if (deadline.expired()) {
      stop_ = Stop::kDeadline;
      return;
    }
    keep_best(s.shortlist, Ranked{s.compare.rank(d, s.asked), slot});
  }
}

const PlaceIndex::Candidates& PlaceIndex::query(const Maplet& maplet, const PlaceSkip& skip,
                                                Deadline deadline) noexcept {
  Scratch& s = *scratch_;
  stop_ = Stop::kConverged;
  PlaceDescriptor::describe(maplet, s.asked);
  s.candidates.clear();
  shortlist(skip, deadline);
  for (const Ranked& ranked : s.shortlist) {
    if (deadline.expired()) {
      stop_ = Stop::kDeadline;
      break;
    }
    const PlaceDescriptor& d = stored_[ranked.slot];
    PlaceCandidate c{d.key, 0.0F, s.compare.guess(d, s.asked)};
    if (c.guesses.empty()) continue;
    c.score = c.guesses.front().score;
    keep_best(s.candidates, c);
  }
  return s.candidates;
}

}  // namespace maplet
