// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/skeleton/consistent_set.hpp"

#include <algorithm>
#include <bit>

namespace maplet {

ConsistentSet::ConsistentSet(int capacity, Arena& arena)
    : capacity_{capacity},
      words_{static_cast<std::size_t>(capacity + 63) / 64},
      bits_{arena.make_array<std::uint64_t>(words_ * static_cast<std::size_t>(capacity),
                                            "skeleton/consistency")},
      candidates_{arena.make_array<std::uint64_t>(words_, "skeleton/consistency")},
      chosen_{arena.make_array<std::uint64_t>(words_, "skeleton/consistency")},
      best_{arena.make_array<std::uint64_t>(words_, "skeleton/consistency")},
      out_{arena.make_array<std::uint64_t>(words_, "skeleton/consistency")} {}

void ConsistentSet::clear(int count) noexcept {
  count_ = count;
  std::fill_n(bits_.begin(), words_ * static_cast<std::size_t>(count), 0);
}

void ConsistentSet::agree(int i, int j) noexcept {
  row(i)[j / 64] |= std::uint64_t{1} << (j % 64);
  row(j)[i / 64] |= std::uint64_t{1} << (i % 64);
}

// A maximal clique with `first` in it: always the candidate that agrees with most others left.
int ConsistentSet::grow(int first) noexcept {
  for (std::size_t w = 0; w < words_; ++w) candidates_[w] = row(first)[w] & ~out_[w];
  candidates_[first / 64] &= ~(std::uint64_t{1} << (first % 64));
  std::fill(chosen_.begin(), chosen_.end(), 0);
  chosen_[first / 64] |= std::uint64_t{1} << (first % 64);
  int size = 1;
  for (;;) {
    int next = -1;
    int most = -1;
    for (int i = 0; i < count_; ++i) {
      if (((candidates_[i / 64] >> (i % 64)) & 1U) == 0U) continue;
      int common = 0;
      for (std::size_t w = 0; w < words_; ++w) common += std::popcount(candidates_[w] & row(i)[w]);
      if (common > most) {
        most = common;
        next = i;
      }
    }
    if (next < 0) return size;
    for (std::size_t w = 0; w < words_; ++w) candidates_[w] &= row(next)[w];
    candidates_[next / 64] &= ~(std::uint64_t{1} << (next % 64));
    chosen_[next / 64] |= std::uint64_t{1} << (next % 64);
    ++size;
  }
}

int ConsistentSet::find(std::span<bool> member) noexcept {
  std::fill(out_.begin(), out_.end(), 0);
  int best = 0;
  for (int i = 0; i < count_; ++i) {
    int degree = 0;
    for (std::size_t w = 0; w < words_; ++w) degree += std::popcount(row(i)[w]);
    if (degree + 1 <= best) continue;
    const int size = grow(i);
    if (size <= best) continue;
    best = size;
    std::swap(best_, chosen_);
  }
  for (int i = 0; i < count_; ++i) member[i] = best > 0 && ((best_[i / 64] >> (i % 64)) & 1U) != 0U;
  return best;
}

int ConsistentSet::find_apart_from(std::span<const bool> member) noexcept {
  std::fill(out_.begin(), out_.end(), 0);
  for (int i = 0; i < count_; ++i)
    if (member[i]) out_[i / 64] |= std::uint64_t{1} << (i % 64);
  int best = 0;
  for (int i = 0; i < count_; ++i)
    if (!member[i]) best = std::max(best, grow(i));
  return best;
}

}  // namespace maplet
