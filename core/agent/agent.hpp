// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "core/agent/agent_config.hpp"
#include "core/agent/encounters.hpp"
#include "core/agent/held_maplets.hpp"
#include "core/agent/map_frame.hpp"
#include "core/agent/maplet_store.hpp"
#include "core/agent/maplet_views.hpp"
#include "core/agent/plane_hold.hpp"
#include "core/agent/range_keeper.hpp"
#include "core/base/arena.hpp"
#include "core/frame/decimator.hpp"
#include "core/maplet/builder.hpp"
#include "core/odometry/tracker.hpp"
#include "core/patches/extractor.hpp"
#include "core/ports/record_sink.hpp"
#include "core/ports/stage_meter.hpp"
#include "core/registration/closure_finder.hpp"
#include "core/registration/registrar.hpp"
#include "core/registration/saliency.hpp"
#include "core/skeleton/skeleton.hpp"

namespace maplet {

/// Who this agent is, in this life.
struct AgentIdentity {
  std::uint16_t agent = 0;
  std::uint32_t epoch = 0;
};

/// What one frame led to. Loans last until the next step.
struct Step {
  Track track;
  const PatchSet* patches = nullptr;
  const Keyframe* keyframe = nullptr;  ///< what this frame became
  const MapletCut* closed = nullptr;   ///< the maplet that ended before it
};

/// The whole path for one agent: depth frame in; track, maplets, delta-poses and skeleton out.
///
/// Delta-poses go to the RecordSink, and into the skeleton as it gives them back.
///
/// Memory   everything from the arena, at construction; nothing later.
/// Time     within the deadline by one small step of the stage that it hits.
/// Threads  one caller.
class Agent {
 public:
  Agent(const AgentConfig& config, AgentIdentity identity, StageMeter& meter, RecordSink& records,
        Arena& arena);

  /// Takes a frame through every stage it is due for.
  [[nodiscard]] Step step(const DepthFrame& frame, Deadline deadline) noexcept;

  /// What it measures its own work with; the machine's, if this is not called. It outlives the
  /// agent.
  void use_clock(const Clock& clock) noexcept { clock_ = &clock; }
  /// The stages share another budget from the next frame on.
  void set_budget(Duration frame_budget) noexcept;

  /// Closes the maplet that is being built: the recording is over.
  /// @return it, or nullptr when there is nothing new
  const MapletCut* finish(Deadline deadline) noexcept;

  /// A maplet of this life from an earlier run, in the order they were made. Before the first
  /// frame.
  /// @return false when it makes no sense
  bool restore(const MapletKey& key, std::span<const std::byte> bytes) noexcept;
  /// What an earlier run left is restored: maplets are numbered from here on, and begin a part
  /// whose relation to the one before is not known until a closure joins them.
  void begin_part(std::uint32_t first_maplet) noexcept;

  /// A measurement wants a maplet's origin at its stamp: the first tracked frame that is not older
  /// becomes one, where a maplet has room for it.
  void ask_origin(Stamp stamp) noexcept { origin_asked_ = stamp; }
  /// Where a tracked frame is in the maplet under construction: what a measurement of that moment
  /// is carried to the origin with (carry_to_origin). @param track  of the newest step
  [[nodiscard]] std::optional<PathPoint> locate(const Track& track) const noexcept {
    return builder_.locate(track);
  }
  /// How likely the newest maplet is to be found again, 0..1: what is shared first.
  [[nodiscard]] float saliency() const noexcept { return saliency_; }
  [[nodiscard]] const MapletCounts& maplet_counts() const noexcept { return builder_.counts(); }
  [[nodiscard]] const RegistrarCounts& link_counts() const noexcept { return registrar_.counts(); }
  /// Of motion = planar, once there is a keyframe.
  [[nodiscard]] std::optional<PlaneHold::Report> plane() const noexcept {
    return plane_ ? plane_->report() : std::nullopt;
  }

  /// Takes in what another agent found out: its delta-pose or closure, as everybody reads it. The
  /// skeleton judges closures; what it makes of all of them in the end is settle()'s.
  Added hear(const DeltaPose& record, Deadline deadline) noexcept;

  /// A range between two agents, as everybody reads it.
  Added hear(const MapletRange& range, Deadline deadline) noexcept;
  /// A sensor measured how far another agent is. Our maplet gets an origin there, now and then.
  void measured(RangeToAgent range) noexcept;
  /// Ties one measured range to maplets, where the other's path is known by now; a record of it
  /// goes to the RecordSink. Between frames.
  void place_range(Deadline deadline) noexcept;
  [[nodiscard]] const RangeCounters& range_counters() const noexcept { return ranges_.counters(); }

  /// A maplet of another agent arrived, encoded. @return false when it is known or makes no sense
  bool hear(const MapletKey& key, std::span<const std::byte> bytes) noexcept {
    return encounters_.hear(key, bytes);
  }
  /// Looks for places that others have seen, too, a step: between frames, or while there are none.
  /// What it finds goes to the RecordSink, as in step().
  /// @return whether there is more to look at
  bool meet(Deadline deadline) noexcept;
  /// Makes a record of a closure that somebody else vouches for (an operator), and hears it.
  /// @return whether the skeleton believes it
  bool say(const DeltaPose& closure, Deadline deadline) noexcept;
  /// Nothing waits: the skeleton once more from the start, so that every agent with the same
  /// records comes to the same poses and verdicts. That work is not cut: it begins when twice the
  /// time that it took last, for a graph of this size, is left.
  /// @return whether the skeleton is settled
  bool settle(Deadline deadline) noexcept;
  /// settle() came to its end, and nothing was added since.
  [[nodiscard]] bool settled() const noexcept { return skeleton_.canonical(); }
  /// An operator's verdict on the closures between two maplets: Skeleton::decide().
  int decide(const MapletKey& a, const MapletKey& b, bool accept, Deadline deadline) noexcept {
    return skeleton_.decide(a, b, accept, deadline);
  }
  /// Where the skeleton expects overlap: maplets of others that are not here yet, those nearest to
  /// ours first. @return how many
  std::size_t expected_near(std::span<MapletKey> out) const noexcept;
  [[nodiscard]] const Encounters& encounters() const noexcept { return encounters_; }
  /// Where odometry's frame stands in the map.
  [[nodiscard]] MapFrame::Notice map_frame() const noexcept { return map_frame_.notice(); }
  /// The shortest way along the skeleton: Skeleton::way().
  [[nodiscard]] Skeleton::Way way(const MapletKey& from, const MapletKey& to,
                                  std::span<MapletKey> maplets) noexcept {
    return skeleton_.way(from, to, maplets);
  }
  /// The maplets held here, for an overlay between two steps.
  [[nodiscard]] HeldMaplets held_maplets() noexcept {
    return {store_, encounters_.foreign(), *older_};
  }

  [[nodiscard]] const AgentIdentity& identity() const noexcept { return identity_; }
  [[nodiscard]] const Skeleton& skeleton() const noexcept { return skeleton_; }
  [[nodiscard]] const TrackerCounters& tracking() const noexcept { return tracker_.counters(); }
  [[nodiscard]] const MapletStore& maplets() const noexcept { return store_; }

 private:
  struct Budget {
    Duration patches, odometry, maplet, registration, skeleton;
  };
  [[nodiscard]] static Budget shares_of(const FrameConfig& frame) noexcept;

  /// Runs a stage under its share of what is left, and measures it.
  template <class Run>
  auto timed(Stage stage, Duration budget, Deadline deadline, Run&& run) noexcept {
    const StageScope scope{meter_, stage, budget};
    return run(deadline.within(budget));
  }
  void take(const MapletCut& closed, Deadline deadline) noexcept;
  void close_loops(const Maplet& newest, Deadline deadline) noexcept;
  void record_and_add(const DeltaPose& delta, Deadline deadline) noexcept;

  void fix_plane(const PatchSet& first_view) noexcept;

  AgentIdentity identity_;
  MonotonicClock monotonic_;
  const Clock* clock_ = &monotonic_;
  FrameConfig frame_;
  Budget budget_;
  StageMeter& meter_;
  RecordSink& records_;
  Decimator decimator_;
  PatchExtractor extractor_;
  Tracker tracker_;
  MapletBuilder builder_;
  Registrar registrar_;
  ClosureFinder closures_;
  Skeleton skeleton_;
  MapletStore store_;
  MapletViews views_;
  Encounters encounters_;
  MapFrame map_frame_;
  std::optional<PlaneHold> plane_;
  std::optional<Stamp> origin_asked_;
  RangeKeeper ranges_;
  Stamp newest_frame_{};
  Stamp range_origin_{};  ///< the last one asked for
  Arena::Owned<Saliency> salient_;
  float saliency_ = 0.0F;
  Duration settling_per_factor_ = std::chrono::microseconds{200};  ///< the last time; a guess first
  Arena::Owned<Maplet> previous_;                                  ///< the maplet before the newest
  Arena::Owned<Maplet> older_;  ///< one that a closure is tried with
};

}  // namespace maplet
