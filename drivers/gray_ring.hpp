// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "core/base/clock.hpp"

namespace maplet {

/// The last images of a gray camera, between its thread and the one that pairs them with depth.
///
/// Memory   kImages images and the one that is being written, made by the constructor.
/// Threads  room() and put() by one, nearest() by another, clear() by any.
class GrayRing {
 public:
  static constexpr std::size_t kImages = 4;

  explicit GrayRing(std::size_t pixels);

  /// Where the next image is written.
  [[nodiscard]] std::span<std::uint8_t> room() noexcept { return writing_; }
  /// It is whole.
  void put(Instant stamp) noexcept;
  /// The camera is gone: what is here is old.
  void clear() noexcept;
  [[nodiscard]] std::uint64_t images() const noexcept;

  /// See GrayCamera::nearest(). Of two equally near ones the earlier.
  [[nodiscard]] std::optional<Instant> nearest(Instant at, Duration tolerance, Duration patience,
                                               std::span<std::uint8_t> to) noexcept;

 private:
  struct Image {
    std::vector<std::uint8_t> pixels;
    std::optional<Instant> stamp;
  };
  std::vector<std::uint8_t> writing_;
  mutable std::mutex mutex_;  ///< guards what follows
  std::condition_variable came_;
  std::array<Image, kImages> images_;
  std::size_t newest_ = 0;
  std::uint64_t count_ = 0;
};

}  // namespace maplet
