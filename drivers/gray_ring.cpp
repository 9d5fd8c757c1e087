// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/gray_ring.hpp"

#include <algorithm>

namespace maplet {

GrayRing::GrayRing(std::size_t pixels) : writing_(pixels) {
  for (Image& image : images_) image.pixels.resize(pixels);
}

void GrayRing::put(Instant stamp) noexcept {
  const std::scoped_lock lock{mutex_};
  newest_ = (newest_ + 1) % kImages;
  images_[newest_].pixels.swap(writing_);
  images_[newest_].stamp = stamp;
  ++count_;
  came_.notify_one();
}

void GrayRing::clear() noexcept {
  const std::scoped_lock lock{mutex_};
  for (Image& image : images_) image.stamp.reset();
}

std::uint64_t GrayRing::images() const noexcept {
  const std::scoped_lock lock{mutex_};
  return count_;
}

std::optional<Instant> GrayRing::nearest(Instant at, Duration tolerance, Duration patience,
                                         std::span<std::uint8_t> to) noexcept {
  std::unique_lock lock{mutex_};
  const auto settled = [&] { return images_[newest_].stamp && *images_[newest_].stamp >= at; };
  // A camera that sends nothing is not waited for.
  if (images_[newest_].stamp && *images_[newest_].stamp >= at - std::chrono::seconds{1}) {
    came_.wait_for(lock, patience, settled);
  }
  const Image* best = nullptr;
  Duration best_off = tolerance + Duration{1};
  for (std::size_t i = 1; i <= kImages; ++i) {  // from the oldest on
    const Image& image = images_[(newest_ + i) % kImages];
    if (!image.stamp) continue;
    const Duration off = std::chrono::abs(*image.stamp - at);
    if (off >= best_off) continue;
    best = &image;
    best_off = off;
  }
  if (best == nullptr || to.size() < best->pixels.size()) return {};
  std::copy(best->pixels.begin(), best->pixels.end(), to.begin());
  return best->stamp;
}

}  // namespace maplet
