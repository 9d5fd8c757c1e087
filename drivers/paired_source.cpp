// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/paired_source.hpp"

#include <algorithm>
#include <utility>

namespace maplet {

Instant StampClock::at(Stamp stamp, Instant came) noexcept {
  const Duration way = came.time_since_epoch() - stamp;
  if (stamp < last_) {  // the device began anew
    before_.reset();
    least_.reset();
  }
  last_ = stamp;
  if (!least_ || came - began_ > kSpan) {
    before_ = least_;
    least_.reset();
    began_ = came;
  }
  least_ = least_ ? std::min(*least_, way) : way;
  return Instant{stamp + (before_ ? std::min(*before_, *least_) : *least_)};
}

PairedSource::PairedSource(std::unique_ptr<DepthSource> depth, GrayCamera& gray,
                           const GrayCameraOptions& options)
    : depth_{std::move(depth)},
      gray_{gray},
      options_{options},
      pixels_(static_cast<std::size_t>(options.camera.width_px) *
              static_cast<std::size_t>(options.camera.height_px)) {}

Expected<DepthFrame> PairedSource::next(Deadline deadline) noexcept {
  auto frame = depth_->next(deadline);
  if (!frame) return frame;
  const Instant came = depth_->came().value_or(monotonic_.now());
  const Instant at = clock_.at(frame->stamp, came) - options_.depth_delay;
  frame->gray = {};
  frame->gray_beside = {};
  if (!gray_.running() || !gray_.nearest(at, options_.tolerance, kPatience, pixels_)) {
    ++gray_.alone;
    return frame;
  }
  ++gray_.paired;
  const CameraModel& camera = options_.camera;
  frame->gray_beside = {{pixels_.data(), camera.width_px, camera.height_px, camera.width_px},
                        camera,
                        options_.T_depth_gray};
  return frame;
}

}  // namespace maplet
