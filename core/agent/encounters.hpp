// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>

#include "core/agent/maplet_store.hpp"
#include "core/base/arena.hpp"
#include "core/base/deadline.hpp"
#include "core/base/static_vector.hpp"
#include "core/registration/delta_pose.hpp"
#include "core/registration/place_index.hpp"
#include "core/registration/place_verifier.hpp"
#include "core/skeleton/skeleton.hpp"

namespace maplet {

/// How matching with one other agent went.
struct EncounterCounts {
  std::uint16_t agent = 0;
  std::uint32_t maplets = 0;  ///< of it that were looked at
  std::uint32_t pairs = 0;    ///< with ours, verified
  std::uint32_t accepted = 0;
  double best_overlap = 0.0;
  std::string_view reason = "no maplet of it was compared yet";  ///< of the latest verdict
};

/// Places that other agents have seen, too: their maplets are kept, and compared with ours without
/// knowing how the agents lie to each other.
///
/// A wrong closure between two maps bends both. So one pair alone is not believed: another, of two
/// other maplets, must say the same; what lies around must not contradict; nor, once it relates the
/// two, must the skeleton. Should another place turn up afterwards that fits nearly as well, it is
/// told as well, one for one: the skeleton then holds both against each other.
///
/// Memory   foreign maplets, a place index over both sides, a verifier: in the arena.
/// Time     work(): one maplet read, one query, one verification or a look at one pair around a
///          place a call; what its deadline cuts is tried again in the next calls, four times: the
///          other place that a maplet fits may be just what there was no time for
/// Threads  one
class Encounters {
 public:
  static constexpr std::size_t kFound = 8;
  using Found = StaticVector<DeltaPose, kFound>;

  struct Capacity {
    std::size_t own = 512;
    std::size_t foreign = 1024;
    std::size_t expected_bytes = 4096;  ///< of a maplet, on average
    std::size_t maplet_bytes = 8192;    ///< at most
  };

  Encounters(const RegistrationConfig& config, const Capacity& capacity, Arena& arena);

  /// A maplet of another agent arrived. @return false when it is known or makes no sense
  bool hear(const MapletKey& key, std::span<const std::byte> bytes) noexcept;
  /// This agent starts again: its maplets before this number have no known relation to those that
  /// come. From now on they are compared with these, as others' are.
  /// @param restored  how many maplets of earlier runs the own store was given. They are found
  /// again
  ///   by others, but ask nothing themselves. work() reads one a call before it does anything else.
  void begin_part(std::uint32_t first_id, std::uint64_t restored) noexcept {
    part_ = first_id;
    restored_ = restored;
  }
  /// The same after a gap in this run.
  void begin_part(std::uint32_t first_id) noexcept { part_ = first_id; }
  /// This agent cut a maplet.
  void add_own(const Maplet& maplet) noexcept;

  /// Places seen again in this agent's own mission are in one plane; other agents carry their
  /// cameras at other heights.
  void hold_to(const PlanarMotion& planar) noexcept { planar_ = planar; }
  /// How well the planes of two own maplets in a row fit: PlaceVerifier::note_fit().
  void note_fit(double chi2_per_dof) noexcept { verifier_.note_fit(chi2_per_dof); }

  [[nodiscard]] bool holds(const MapletKey& key) const noexcept {
    return foreign_.find(key).has_value();
  }
  /// Something waits to be compared.
  [[nodiscard]] bool busy() const noexcept {
    return waiting_count_ > 0 || asking_ || recalled_ < restored_;
  }
  /// Goes on comparing, a step. @return accepted closures between two agents, new ones
  [[nodiscard]] Found work(const Skeleton& skeleton, const MapletStore& own, MapletKey self,
                           Deadline deadline) noexcept;

  [[nodiscard]] std::span<const EncounterCounts> counts() const noexcept {
    return {counts_.data(), counts_.size()};
  }
  [[nodiscard]] const MapletStore& foreign() const noexcept { return foreign_; }
  [[nodiscard]] std::uint64_t foreign_maplets() const noexcept { return foreign_.count(); }

 private:
  static constexpr std::size_t kWaiting = 256;
  static constexpr std::size_t kHypotheses = 512;
  static constexpr std::size_t kAgents = 32;
  static constexpr int kMostCuts = 4;

  struct Told {
    std::size_t hypothesis;
    bool answered;  ///< a rival of it has been told, too, or it is one
  };

  [[nodiscard]] bool load(const MapletKey& key, const MapletStore& own, const MapletKey& self,
                          Maplet& out) const noexcept;
  void wait(const MapletKey& key) noexcept;
  void recall(const MapletStore& own) noexcept;
  void ask(const MapletStore& own, const MapletKey& self, Deadline deadline) noexcept;
  void verify(const MapletStore& own, const MapletKey& self, Deadline deadline) noexcept;
  void next_candidate() noexcept;
  [[nodiscard]] Found judge(const Skeleton& skeleton, const MapletStore& own,
                            const MapletKey& self) noexcept;
  [[nodiscard]] Found report(const Skeleton& skeleton, const MapletKey& self) noexcept;
  [[nodiscard]] bool worth_telling(const PlaceHypothesis& h,
                                   const Skeleton& skeleton) const noexcept;
  void tell(std::size_t hypothesis, bool answered, const MapletKey& self, Found& found) noexcept;
  void tell_rivals(const Skeleton& skeleton, const MapletKey& self, Found& found) noexcept;
  [[nodiscard]] bool told(const PlaceHypothesis& h) const noexcept;
  [[nodiscard]] bool unlooked(const PlaceHypothesis& h, const Skeleton& skeleton) const noexcept;
  void begin_look(const PlaceHypothesis& h, const Skeleton& skeleton, const MapletStore& own,
                  const MapletKey& self) noexcept;
  void look(const MapletStore& own, const MapletKey& self, Deadline deadline) noexcept;
  [[nodiscard]] bool trusted(const PlaceHypothesis& h, const Skeleton& skeleton) const noexcept;
  [[nodiscard]] bool linked(const Skeleton& skeleton, const MapletKey& a,
                            const MapletKey& b) const noexcept;
  EncounterCounts& counts_of(std::uint16_t agent) noexcept;

  MapletStore foreign_;
  PlaceIndex index_;
  PlaceVerifier verifier_;
  std::optional<PlanarMotion> planar_;
  StaticVector<Told, kHypotheses> told_;  ///< of the verifier's: they are in the skeleton, or gone
  Arena::Owned<Maplet> a_;
  Arena::Owned<Maplet> b_;
  std::array<MapletKey, kWaiting> waiting_{};  ///< a ring
  std::size_t waiting_first_ = 0;
  std::size_t waiting_count_ = 0;
  bool asking_ = false;  ///< candidates_ of asked_ are being verified
  MapletKey asked_;
  Surroundings around_;
  std::optional<std::size_t> looking_;  ///< around this hypothesis
  std::size_t next_candidate_ = 0;
  std::size_t next_guess_ = 0;  ///< of this candidate
  bool in_time_ = true;         ///< its guesses so far
  int cuts_ = 0;                ///< in a row, of what is being done
  std::uint32_t part_ = 0;      ///< first own maplet since the start
  std::uint64_t restored_ = 0;
  std::uint64_t recalled_ = 0;  ///< of these, in the index
  PlaceIndex::Candidates candidates_;
  StaticVector<EncounterCounts, kAgents> counts_;
};

}  // namespace maplet
