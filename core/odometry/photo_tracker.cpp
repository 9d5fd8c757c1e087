// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/odometry/photo_tracker.hpp"

#include <algorithm>

namespace maplet {

namespace {

constexpr int kRowsBetween = 8;
constexpr std::uint64_t kPrime = 0x100000001b3;  // FNV-1a
constexpr double kFollow = 0.1;                  // of a frame's inflation
constexpr double kMostInflation = 1e4;
// Interpolation and the choice of the steepest points err alike everywhere: regions do not see it.
constexpr double kLeastInflation = 16.0;

}  // namespace

void PhotoTracker::assign(const DepthFrame& frame) noexcept {
  pyramid_.clear();
  if (!enabled_) return;
  const bool beside = !frame.gray_beside.pixels.empty();
  if (repeats(beside ? frame.gray_beside.pixels : frame.gray)) return;
  if (beside) {
    T_gray_depth_ = frame.gray_beside.T_depth_gray.inverse();
    pyramid_.assign(frame.gray_beside.pixels, frame.gray_beside.camera);
  } else if (!frame.gray.empty()) {
    T_gray_depth_ = {};
    pyramid_.assign(frame.gray, frame.camera);
  }
}

// No camera takes the same image twice: its noise differs.
bool PhotoTracker::repeats(const ImageView<std::uint8_t>& gray) noexcept {
  if (gray.empty()) return false;
  std::uint64_t sum = 1;
  for (int v = 0; v < gray.height_px; v += kRowsBetween) {
    for (int u = 0; u < gray.width_px; ++u) sum = kPrime * (sum ^ gray.at(u, v));
  }
  const bool same = sum == last_image_;
  last_image_ = sum;
  return same;
}

double PhotoTracker::inflation() const noexcept {
  return std::clamp(by_region_ * std::max(1.0, against_patches_.value()), kLeastInflation,
                    kMostInflation);
}

void PhotoTracker::learn(const Alignment& alignment) noexcept {
  if (!alignment.gray) return;
  by_region_ += kFollow * (std::clamp(alignment.photo_inflation, 1.0, kMostInflation) - by_region_);
  // What is seen of the disagreement was whitened with the inflation of now: its own part is
  // undone.
  const double was = std::max(1.0, against_patches_.value());
  against_patches_.add(was * alignment.photo_disagreement, alignment.expected_photo_disagreement);
}

}  // namespace maplet
