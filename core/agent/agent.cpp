// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/agent/agent.hpp"

#include <algorithm>
#include <cstdlib>

#include "core/agent/own_places.hpp"
#include "core/maplet/codec.hpp"

namespace maplet {

namespace {

constexpr Duration kOriginsApart = std::chrono::seconds{5};  // that ranges ask for

Duration share_of(const FrameConfig& frame, double share) noexcept {
  return Duration{static_cast<Duration::rep>(static_cast<double>(frame.budget.count()) * share)};
}

}  // namespace

Agent::Agent(const AgentConfig& config, AgentIdentity identity, StageMeter& meter,
             RecordSink& records, Arena& arena)
    : identity_{identity},
      frame_{config.frame},
      budget_{shares_of(config.frame)},
      meter_{meter},
      records_{records},
      decimator_{config.decimator, arena, config.limits.image()},
      extractor_{config.patches, arena, config.limits.image().decimated(config.decimator.step)},
      tracker_{config.odometry, arena},
      builder_{config.maplet, config.limits.image().decimated(config.decimator.step), arena},
      registrar_{config.registration, arena},
      closures_{config.registration, arena},
      skeleton_{config.skeleton, arena},
      store_{static_cast<std::size_t>(config.limits.own_maplets),
             config.limits.expected_maplet_bytes(),
             static_cast<std::size_t>(config.maplet.max_bytes), arena},
      views_{store_, arena},
      encounters_{config.registration,
                  {static_cast<std::size_t>(config.limits.own_maplets),
                   static_cast<std::size_t>(config.limits.foreign_maplets),
                   config.limits.expected_maplet_bytes(),
                   static_cast<std::size_t>(config.maplet.max_bytes)},
                  arena},
      salient_{arena.make<Saliency>("agent/saliency")},
      previous_{arena.make<Maplet>("agent/previous maplet")},
      older_{arena.make<Maplet>("agent/older maplet")} {
  builder_.identify(identity.agent, identity.epoch, 0);
  builder_.know_up(config.mounting);
  if (config.planar) plane_.emplace(config.mounting);
  tracker_.look_through(views_);
}

Agent::Budget Agent::shares_of(const FrameConfig& frame) noexcept {
  return {share_of(frame, frame.patches_share), share_of(frame, frame.odometry_share),
          share_of(frame, frame.maplet_share), share_of(frame, frame.registration_share),
          share_of(frame, frame.skeleton_share)};
}

void Agent::set_budget(Duration frame_budget) noexcept {
  frame_.budget = frame_budget;
  budget_ = shares_of(frame_);
}

Step Agent::step(const DepthFrame& full_frame, Deadline deadline) noexcept {
  Step step;
  const DepthFrame frame = decimator_.run(full_frame);
  step.patches = timed(Stage::kPatches, budget_.patches, deadline,
                       [&](Deadline until) { return &extractor_.run(frame, until); });
  step.track = timed(Stage::kOdometry, budget_.odometry, deadline,
                     [&](Deadline until) { return tracker_.run(frame, *step.patches, until); });
  if (plane_) plane_->hold(step.track);
  newest_frame_ = frame.stamp;
  if (!ranges_.empty()) ranges_.at_frame(frame.stamp, locate(step.track));
  if (!skeleton_.settled())
    timed(Stage::kSkeleton, budget_.skeleton, deadline,
          [&](Deadline until) { return skeleton_.update(until); });
  map_frame_.update(skeleton_, step.track.T_odom_camera.se3);
  const bool origin =
      origin_asked_ && step.track.state == Track::State::kTracking && frame.stamp >= *origin_asked_;
  if (!step.track.keyframe_due && !origin) return step;
  if (origin) {
    builder_.ask_origin();
    origin_asked_.reset();
  }
  if (plane_ && !plane_->fixed()) fix_plane(*step.patches);

  step.keyframe = &tracker_.make_keyframe(frame, *step.patches, step.track);
  views_.saw(*step.keyframe);
  step.closed = timed(Stage::kMaplet, budget_.maplet, deadline,
                      [&](Deadline until) { return builder_.add(*step.keyframe, &frame, until); });
  if (step.closed != nullptr) take(*step.closed, deadline);
  return step;
}

void Agent::fix_plane(const PatchSet& first_view) noexcept {
  const PlanarMotion& planar = plane_->fix(first_view);
  builder_.hold_to(planar);
  registrar_.hold_to(planar);
  closures_.hold_to(planar);
  encounters_.hold_to(planar);
}

const MapletCut* Agent::finish(Deadline deadline) noexcept {
  const MapletCut* closed = builder_.finish();
  if (closed != nullptr) take(*closed, deadline);
  constexpr int kMostUpdates = 10'000;
  for (int k = 0; k < kMostUpdates && !skeleton_.settled() && !deadline.expired(); ++k)
    skeleton_.update(deadline);
  return closed;
}

bool Agent::restore(const MapletKey& key, std::span<const std::byte> bytes) noexcept {
  const auto named = key_of(bytes);
  if (!named || *named != key || !store_.put(key, bytes)) return false;
  skeleton_.add(key);
  if (plane_ && decode(bytes, *older_)) plane_->go_on(older_->up);
  return true;
}

void Agent::begin_part(std::uint32_t first_maplet) noexcept {
  builder_.identify(identity_.agent, identity_.epoch, first_maplet);
  encounters_.begin_part(first_maplet, store_.count());
}

Added Agent::hear(const DeltaPose& record, Deadline deadline) noexcept {
  return timed(Stage::kSkeleton, budget_.skeleton, deadline,
               [&](Deadline until) { return skeleton_.add(record, until); });
}

Added Agent::hear(const MapletRange& range, Deadline deadline) noexcept {
  Sight sight;
  sight.a = range.a;
  sight.b = range.b;
  sight.range_m = range.range_m;
  sight.range_sigma_m = range.sigma_m;
  sight.stamp = range.stamp;
  return timed(Stage::kSkeleton, budget_.skeleton, deadline,
               [&](Deadline until) { return skeleton_.add(sight, until); });
}

void Agent::measured(RangeToAgent range) noexcept {
  if (range.stamp == Stamp{}) range.stamp = newest_frame_;
  ranges_.note(range);
  if (range.stamp - range_origin_ < kOriginsApart) return;
  range_origin_ = range.stamp;
  ask_origin(range.stamp);
}

void Agent::place_range(Deadline deadline) noexcept {
  const auto range = ranges_.place(skeleton_);
  if (!range) return;
  if (const auto record = records_.put(*range)) (void)hear(*record, deadline);
}

bool Agent::say(const DeltaPose& closure, Deadline deadline) noexcept {
  const auto record = records_.put(closure);
  if (!record || hear(*record, deadline) != Added::kLinked) return false;
  return skeleton_.factor(skeleton_.factor_count() - 1).verdict != ClosureState::kRejected;
}

bool Agent::settle(Deadline deadline) noexcept {
  if (skeleton_.canonical()) return true;
  const Duration expected = 2 * settling_per_factor_ * std::max(skeleton_.factor_count(), 1);
  if (deadline.remaining() < expected) return false;
  const StageScope scope{meter_, Stage::kSkeleton, budget_.skeleton};
  const Instant begin = clock_->now();
  const bool settled = skeleton_.settle(Deadline::never());
  settling_per_factor_ = (clock_->now() - begin) / std::max(skeleton_.factor_count(), 1);
  return settled;
}

bool Agent::meet(Deadline deadline) noexcept {
  if (!encounters_.busy()) return false;
  const MapletKey self{identity_.agent, identity_.epoch, 0};
  const auto found =
      timed(Stage::kRegistration, budget_.registration, deadline,
            [&](Deadline until) { return encounters_.work(skeleton_, store_, self, until); });
  for (const DeltaPose& closure : found) (void)say(closure, deadline);
  return encounters_.busy();
}

void Agent::take(const MapletCut& closed, Deadline deadline) noexcept {
  const MapletKey& key = closed.maplet.key;
  if (!store_.put(key, closed.bytes)) std::abort();
  views_.add(closed.maplet);
  timed(Stage::kRegistration, budget_.registration, deadline, [&](Deadline) {
    store_.set_frontier(key, find_frontier(closed.maplet, up_of(closed.maplet)).region);
    saliency_ = static_cast<float>(salient_->of(closed.maplet));
  });
  skeleton_.add(key);
  if (closed.link.valid) {
    const DeltaPose link =
        timed(Stage::kRegistration, budget_.registration, deadline, [&](Deadline until) {
          return registrar_.link(*previous_, closed.maplet, closed.link, until);
        });
    record_and_add(link, deadline);
    encounters_.note_fit(registrar_.fit());
    if (loose(link.covariance)) encounters_.begin_part(key.id);
  }
  map_frame_.hang_from(key, closed.T_odom_origin);
  close_loops(closed.maplet, deadline);
  encounters_.add_own(closed.maplet);
  *previous_ = closed.maplet;
}

void Agent::close_loops(const Maplet& newest, Deadline deadline) noexcept {
  OwnPlaces places{skeleton_, views_, store_, *older_};
  const auto closures = timed(Stage::kRegistration, budget_.registration, deadline,
                              [&](Deadline until) { return closures_.run(newest, places, until); });
  for (const DeltaPose& closure : closures) record_and_add(closure, deadline);
}

void Agent::record_and_add(const DeltaPose& delta, Deadline deadline) noexcept {
  const auto record = records_.put(delta);
  if (!record) return;
  timed(Stage::kSkeleton, budget_.skeleton, deadline,
        [&](Deadline until) { return skeleton_.add(*record, until); });
}

}  // namespace maplet
