// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "core/base/arena.hpp"
#include "core/base/deadline.hpp"
#include "core/base/static_vector.hpp"
#include "core/maplet/maplet.hpp"
#include "core/registration/place_compare.hpp"
#include "core/registration/place_descriptor.hpp"

namespace maplet {

/// A maplet that may show the same place as the one asked about.
struct PlaceCandidate {
  MapletKey key;                  ///< of the stored maplet, a
  float score = 0.0F;             ///< of its best guess, 0..1
  PlaceCompare::Guesses guesses;  ///< T_a_b, b the maplet asked about; the best first
};

/// Which of the stored maplets are not asked about: those of the asker's own path.
struct PlaceSkip {
  int agent = -1;         ///< negative: all are asked about
  bool all_lives = true;  ///< of that agent; else only those of `epoch` from `first_id` on
  std::uint32_t epoch = 0;
  std::uint32_t first_id = 0;

  [[nodiscard]] bool operator()(const MapletKey& key) const noexcept {
    return static_cast<int>(key.agent) == agent &&
           (all_lives || (key.epoch == epoch && key.id >= first_id));
  }
};

/// Where a maplet may be, when nothing says how it lies to those that are stored: their
/// descriptors, compared one by one.
///
/// Memory   capacity descriptors (2.4 KB each) and a scratch in the arena; beyond the capacity the
///          one added first goes.
/// Time     query: ~10 us a stored maplet, then ~100 us for each of the kShortlist best; stops
///          between two at the deadline with the best so far
/// Threads  one
/// Math     docs/math/icap.md, section 7
class PlaceIndex {
 public:
  static constexpr std::size_t kShortlist = 24;
  static constexpr std::size_t kCandidates = 16;
  using Candidates = StaticVector<PlaceCandidate, kCandidates>;

  PlaceIndex(std::size_t capacity, Arena& arena);

  /// Remembers a maplet; one with the same key is replaced.
  void add(const Maplet& maplet) noexcept;

  /// @return candidates, the best first, without the maplet itself; valid until the next call
  [[nodiscard]] const Candidates& query(const Maplet& maplet, const PlaceSkip& skip,
                                        Deadline deadline) noexcept;

  [[nodiscard]] std::size_t size() const noexcept { return count_; }
  [[nodiscard]] std::uint64_t forgotten() const noexcept { return forgotten_; }
  /// Stop of the last query.
  [[nodiscard]] Stop stop() const noexcept { return stop_; }

 private:
  struct Ranked {
    float score;
    std::uint32_t slot;
  };
  struct Scratch {
    PlaceDescriptor asked;
    PlaceCompare compare;
    StaticVector<Ranked, kShortlist> shortlist;
    Candidates candidates;
  };

  void shortlist(const PlaceSkip& skip, Deadline deadline) noexcept;

  std::span<PlaceDescriptor> stored_;
  std::size_t count_ = 0;
  std::size_t next_ = 0;
  std::uint64_t forgotten_ = 0;
  Stop stop_ = Stop::kConverged;
  Arena::Owned<Scratch> scratch_;
};

}  // namespace maplet
