// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/maplet/builder.hpp"

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "core/maplet/codec.hpp"

namespace maplet {

namespace {

constexpr double kFullShare =
    0.92;  // of max_bytes, as estimated: a maplet ends before planes must go

// Covariance of T_a_c from those of T_a_b and T_b_c, each in the tangent of its own right frame.
Matrix6d chain(const Matrix6d& of_b, const Se3& T_b_c, const Matrix6d& of_c) noexcept {
  const Matrix6d ad = T_b_c.inverse().adjoint();
  return ad * of_b * ad.transpose() + of_c;
}

}  // namespace

MapletBuilder::MapletBuilder(const MapletConfig& config, Arena& arena)
    : config_{config},
      map_{config, arena},
      rule_{config},
      draft_{arena.make<Maplet>("maplet/draft")},
      cut_{arena.make<MapletCut>("maplet/finished")},
      bytes_{arena.make_array<std::byte>(kMaxMapletBytes, "maplet/bytes")} {
  const int overlap = std::min(config.overlap_keyframes, config.max_keyframes - 1);
  for (int i = 0; i < overlap; ++i) {
    recent_.push_back(arena.make<Keyframe>("maplet/overlap keyframe"));
  }
}

void MapletBuilder::identify(std::uint16_t agent, std::uint32_t epoch,
                             std::uint32_t first_id) noexcept {
  key_ = {agent, epoch, first_id};
}

const MapletCut* MapletBuilder::add(const Keyframe& keyframe, Deadline deadline) noexcept {
  const MapletCut* done = nullptr;
  if (members_.empty()) {
    start(keyframe);
  } else if (keyframe.segment != segment_ || keyframe.blind_spells != blind_spells_) {
    const Member last = members_.back();
    done = cut(CutReason::kLost);
    const Se3 T_last_this = last.T_odom_camera.inverse() * keyframe.T_odom_camera.se3;
    link_to(last.T_origin_camera * T_last_this,
            chain(last.covariance, T_last_this, keyframe.covariance));
    start(keyframe);
  } else if (const CutReason reason = due(keyframe); reason != CutReason::kNone) {
    done = cut(reason);
    start_overlapping(deadline);
  }
  take(keyframe, deadline);
  return done;
}

const MapletCut* MapletBuilder::finish() noexcept {
  if (members_.empty() || (shared_ > 0 && members_.size() <= shared_)) return nullptr;
  const MapletCut* done = cut(CutReason::kEnd);
  link_.valid = false;
  members_.clear();
  shared_ = 0;
  return done;
}

CutReason MapletBuilder::due(const Keyframe& keyframe) const noexcept {
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

// The last keyframes of the maplet that ended are the first of the next.
void MapletBuilder::start_overlapping(Deadline deadline) noexcept {
  const std::size_t shared =
      std::min({recent_.size(), recent_count_, std::max<std::size_t>(1, members_.size() / 2)});
  const std::size_t end = recent_count_;
  const std::size_t first = end - shared;
  const Member& origin = members_[members_.size() - shared];
  link_to(origin.T_origin_camera, origin.covariance);
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

void MapletBuilder::take(const Keyframe& keyframe, Deadline deadline) noexcept {
  Member member{keyframe.stamp, keyframe.T_odom_camera.se3, Se3{}, Matrix6d::Zero(),
                keyframe.patches.valid_pixels};
  if (!members_.empty()) {
    const Member& last = members_.back();
    const Se3 T_last_this = last.T_odom_camera.inverse() * member.T_odom_camera;
    member.covariance = chain(last.covariance, T_last_this, keyframe.covariance);
    member.T_origin_camera =
        map_.refine(keyframe.patches, last.T_origin_camera * T_last_this, keyframe.covariance);
    rule_.go(member.T_odom_camera);
  }
  members_.push_back(member);
  map_.add(keyframe.patches, member.T_origin_camera, member.covariance, deadline);
  remember(keyframe);
}

void MapletBuilder::remember(const Keyframe& keyframe) noexcept {
  Keyframe& slot = *recent_[recent_count_ % recent_.size()];
  if (&slot != &keyframe) slot = keyframe;
  ++recent_count_;
}

const MapletCut* MapletBuilder::cut(CutReason reason) noexcept {
  Expected<std::size_t> size = fail(ErrorCode::kCapacity, "not tried yet");
  std::size_t limit = kMaxMapletPlanes;
  const auto max_bytes = static_cast<std::size_t>(config_.max_bytes);
  for (;;) {
    draft_->clear();
    draft_->key = key_;
    draft_->stamp = members_.front().stamp;
    for (const Member& m : members_) {
      draft_->keyframes.push_back(
          {m.stamp, Transform<MapletFrame, CameraFrame>{m.T_origin_camera}});
    }
    map_.assemble(*draft_, limit);
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
  cut_->origin_valid_pixels = members_.front().valid_pixels;
  ++key_.id;
  return cut_.get();
}

}  // namespace maplet
