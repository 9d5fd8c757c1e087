// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/maplet/builder.hpp"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <utility>

#include "core/maplet/codec.hpp"
#include "core/maplet/structure.hpp"

namespace maplet {

namespace {

constexpr double kFullShare =
    0.92;  // of max_bytes, as estimated: a maplet ends before planes must go
constexpr double kWorthMoving = 1.2;  // times the structure at the usual boundary

// Covariance of T_a_c from those of T_a_b and T_b_c, each in the tangent of its own right frame.
Matrix6d chain(const Matrix6d& of_b, const Se3& T_b_c, const Matrix6d& of_c) noexcept {
  const Matrix6d ad = T_b_c.inverse().adjoint();
  return ad * of_b * ad.transpose() + of_c;
}

}  // namespace

MapletBuilder::MapletBuilder(const MapletConfig& config, ImageSize image, Arena& arena)
    : config_{config},
      map_{config, arena},
      rule_{config},
      draft_{arena.make<Maplet>("maplet/draft")},
      cut_{arena.make<MapletCut>("maplet/finished")},
      bytes_{arena.make_array<std::byte>(kMaxMapletBytes, "maplet/bytes")} {
  const int kept =
      std::min(config.overlap_keyframes + config.boundary_keyframes, config.max_keyframes - 1);
  for (int i = 0; i < kept; ++i) {
    recent_.push_back(arena.make<Keyframe>("maplet/overlap keyframe"));
  }
  for (int i = 0; i < config.max_keyframes; ++i) {
    depths_.push_back(arena.make<KeptDepth>("maplet/kept depth", image, arena));
  }
}

void MapletBuilder::identify(std::uint16_t agent, std::uint32_t epoch,
                             std::uint32_t first_id) noexcept {
  key_ = {agent, epoch, first_id};
}

const MapletCut* MapletBuilder::add(const Keyframe& keyframe, const DepthFrame* frame,
                                    Deadline deadline) noexcept {
  const MapletCut* done = nullptr;
  up_.look(keyframe);
  const bool asked = std::exchange(origin_asked_, false);
  if (members_.empty()) {
    start(keyframe);
  } else if (keyframe.segment != segment_ || keyframe.blind_spells != blind_spells_) {
    const Member next = follow(keyframe);
    done = cut(CutReason::kLost, deadline);
    link_to(next.T_origin_camera, next.covariance);
    start(keyframe);
  } else if (asked && members_.size() < static_cast<std::size_t>(config_.max_keyframes)) {
    see(keyframe, frame, deadline);
    done = cut(CutReason::kAsked, deadline);
    start_overlapping(1, deadline);
    return done;
  } else if (const CutReason reason = due(keyframe); reason != CutReason::kNone) {
    done = cut(reason, deadline);
    start_overlapping(choose_overlap(), deadline);
  }
  see(keyframe, frame, deadline);
  return done;
}

// Its image is at hand now only.
void MapletBuilder::see(const Keyframe& keyframe, const DepthFrame* frame,
                        Deadline deadline) noexcept {
  KeptDepth& depth = *depths_[members_.size()];
  if (frame != nullptr) {
    depth.take(*frame);
  } else {
    depth.draw(keyframe.patches);
  }
  take(keyframe, deadline);
}

const MapletCut* MapletBuilder::finish() noexcept {
  if (members_.empty() || (shared_ > 0 && members_.size() <= shared_)) return nullptr;
  const MapletCut* done = cut(CutReason::kEnd, Deadline::never());
  link_.valid = false;
  members_.clear();
  shared_ = 0;
  return done;
}

CutReason MapletBuilder::due(const Keyframe& keyframe) noexcept {
  // It must bring something that the maplet before it has not, and leave the next another origin.
  if (members_.size() <= std::max<std::size_t>(shared_, 1)) return CutReason::kNone;
  if (members_.size() >= static_cast<std::size_t>(config_.max_keyframes)) {
    return CutReason::kKeyframes;
  }
  const std::size_t keyframe_bytes = 24 * members_.size();
  if (static_cast<double>(map_.estimated_bytes() + keyframe_bytes) >
      kFullShare * config_.max_bytes) {
    return CutReason::kBytes;
  }
  if (!map_.open(Eigen::Vector3d::Zero(), follow(keyframe).T_origin_camera.t)) {
    return CutReason::kHidden;
  }
  return rule_.check(keyframe.T_odom_camera.se3);
}

void MapletBuilder::start(const Keyframe& origin) noexcept {
  members_.clear();
  map_.clear();
  rule_.start(origin.T_odom_camera.se3);
  shared_ = 0;
  segment_ = origin.segment;
  blind_spells_ = origin.blind_spells;
  recent_count_ = 0;
}

// How many of the last keyframes the next maplet begins with: in sight of this origin, then with
// most structure around it.
std::size_t MapletBuilder::choose_overlap() noexcept {
  const std::size_t most =
      std::min({recent_.size(), recent_count_, std::max<std::size_t>(1, members_.size() / 2)});
  const auto usual = std::min(static_cast<std::size_t>(config_.overlap_keyframes), most);
  const auto range = static_cast<std::size_t>(config_.boundary_keyframes);
  const auto origin = [&](std::size_t shared) -> const Member& {
    return members_[members_.size() - shared];
  };
  std::size_t best = usual;
  bool best_open = map_.open(Eigen::Vector3d::Zero(), origin(usual).T_origin_camera.t);
  double worth = kWorthMoving * origin(usual).structure;
  for (std::size_t n = usual > range ? usual - range : 1; n <= std::min(most, usual + range); ++n) {
    const bool open = map_.open(Eigen::Vector3d::Zero(), origin(n).T_origin_camera.t);
    if (open < best_open || (open == best_open && origin(n).structure <= worth)) continue;
    best = n;
    best_open = open;
    worth = origin(n).structure;
  }
  if (!best_open) ++map_.counts().hidden_origins;
  return best;
}

// The last keyframes of the maplet that ended are the first of the next.
void MapletBuilder::start_overlapping(std::size_t shared, Deadline deadline) noexcept {
  const std::size_t end = recent_count_;
  const std::size_t first = end - shared;
  const Member& origin = members_[members_.size() - shared];
  link_to(origin.T_origin_camera, origin.covariance);
  for (std::size_t i = 0; i < shared; ++i) {
    std::swap(depths_[i], depths_[members_.size() - shared + i]);
  }
  start(*recent_[first % recent_.size()]);
  for (std::size_t i = first; i < end; ++i) {
    recent_count_ = i;  // each keeps its place in the ring
    take(*recent_[i % recent_.size()], deadline);
  }
  shared_ = shared;
}

void MapletBuilder::link_to(const Se3& T_previous_this, const Matrix6d& covariance) noexcept {
  link_.valid = true;
  link_.previous = cut_->maplet.key;
  link_.stamp_previous = cut_->maplet.stamp;
  link_.T_previous_this = Transform<MapletFrame, MapletFrame>{T_previous_this};
  link_.covariance = covariance;
}

// A keyframe as the odometry continues from the last one.
MapletBuilder::Member MapletBuilder::follow(const Keyframe& keyframe) const noexcept {
  Member member;
  member.keyframe_id = keyframe.id;
  member.stamp = keyframe.stamp;
  member.T_odom_camera = keyframe.T_odom_camera.se3;
  if (members_.empty()) return member;
  const Member& last = members_.back();
  PlanarMotion::Conditioned step{
      (keyframe.T_odom_before * last.T_odom_camera).inverse() * member.T_odom_camera,
      keyframe.covariance};
  if (planar_) step = planar_->condition(step.T, step.covariance);
  member.covariance = chain(last.covariance, step.T, step.covariance);
  member.T_origin_camera = last.T_origin_camera * step.T;
  return member;
}

void MapletBuilder::take(const Keyframe& keyframe, Deadline deadline) noexcept {
  Member member = follow(keyframe);
  member.valid_pixels = keyframe.patches.valid_pixels;
  member.structure = structure_of(keyframe.patches);
  if (!members_.empty()) {
    member.T_origin_camera =
        map_.refine(keyframe.patches, member.T_origin_camera, keyframe.covariance);
    if (planar_) member.T_origin_camera = planar_->project(member.T_origin_camera);
    rule_.go(member.T_odom_camera);
  }
  const KeptDepth& depth = *depths_[members_.size()];
  members_.push_back(member);
  map_.add(keyframe.patches, depth, member.T_origin_camera, member.covariance, deadline);
  remember(keyframe);
}

void MapletBuilder::remember(const Keyframe& keyframe) noexcept {
  Keyframe& slot = *recent_[recent_count_ % recent_.size()];
  if (&slot != &keyframe) slot = keyframe;
  ++recent_count_;
}

std::optional<PathPoint> MapletBuilder::locate(const Track& track) const noexcept {
  if (track.state != Track::State::kTracking) return {};
  const auto member = std::find_if(members_.begin(), members_.end(), [&](const Member& m) {
    return m.keyframe_id == track.keyframe_id;
  });
  if (member == members_.end()) return {};
  const Se3& T_member_camera = track.T_keyframe_camera.se3;
  PathPoint point;
  point.maplet = key_;
  point.stamp = track.stamp;
  point.stamp_maplet = members_.front().stamp;
  point.T_maplet_camera =
      Transform<MapletFrame, CameraFrame>{member->T_origin_camera * T_member_camera};
  point.covariance = chain(member->covariance, T_member_camera, track.covariance);
  return point;
}

const MapletCut* MapletBuilder::cut(CutReason reason, Deadline deadline) noexcept {
  StaticVector<KeyframeLook, kMaxMapletKeyframes> looks;
  for (std::size_t i = 0; i < members_.size(); ++i) {
    looks.push_back({members_[i].T_origin_camera, &*depths_[i]});
  }
  Expected<std::size_t> size = fail(ErrorCode::kCapacity, "not tried yet");
  std::size_t limit = kMaxMapletPlanes;
  const auto max_bytes = static_cast<std::size_t>(config_.max_bytes);
  for (;;) {
    draft_->clear();
    draft_->key = key_;
    draft_->stamp = members_.front().stamp;
    draft_->up = planar_ ? planar_->up() : up_.at(members_.front().T_odom_camera);
    for (const Member& m : members_) {
      draft_->keyframes.push_back(
          {m.stamp, Transform<MapletFrame, CameraFrame>{m.T_origin_camera}});
    }
    map_.assemble(*draft_, {looks.data(), looks.size()}, limit, deadline);
    size = encode(*draft_, bytes_);
    if (size && *size <= max_bytes) break;
    if (draft_->planes.empty()) break;
    const double share = size ? static_cast<double>(max_bytes) / static_cast<double>(*size) : 0.5;
    const auto planes = static_cast<double>(draft_->planes.size());
    limit = std::min(draft_->planes.size() - 1, static_cast<std::size_t>(0.97 * share * planes));
  }
  if (!size || *size > max_bytes || !decode(bytes_.first(*size), cut_->maplet)) {
    std::fputs("mapletd: bug: a maplet of ours cannot be written\n", stderr);
    std::abort();
  }
  cut_->bytes = bytes_.first(*size);
  cut_->link = link_;
  cut_->reason = reason;
  cut_->points = map_.points();
  cut_->origin_valid_pixels = members_.front().valid_pixels;
  cut_->T_odom_origin = members_.front().T_odom_camera;
  ++key_.id;
  return cut_.get();
}

}  // namespace maplet
