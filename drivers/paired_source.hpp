// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "core/ports/depth_source.hpp"
#include "drivers/gray_camera.hpp"

namespace maplet {

/// When things happened on the monotonic clock, of a device that stamps them by a clock of its own.
///
/// The quickest way here in the last seconds says how the clocks stand: a frame comes late, never
/// early. It follows a device whose clock drifts, kSpan behind at most.
///
/// Memory   fixed. Threads  one caller.
class StampClock {
 public:
  static constexpr Duration kSpan = std::chrono::seconds{5};

  /// @param came  when the thing with this stamp was here
  /// @return when it was made, as late as the quickest one lets it be
  [[nodiscard]] Instant at(Stamp stamp, Instant came) noexcept;

 private:
  std::optional<Duration> before_;  ///< least of (came - stamp) in the span before this one
  std::optional<Duration> least_;   ///< and in this one
  Instant began_{};
  Stamp last_{};
};

/// A depth camera with the images of a gray camera beside it: each depth frame gets the one nearest
/// in time, or none.
///
/// Memory   one image, made by the constructor.
/// Threads  as DepthSource; the gray camera outlives it.
class PairedSource final : public DepthSource {
 public:
  static constexpr Duration kPatience = std::chrono::milliseconds{10};

  PairedSource(std::unique_ptr<DepthSource> depth, GrayCamera& gray,
               const GrayCameraOptions& options);

  [[nodiscard]] Expected<DepthFrame> next(Deadline deadline) noexcept override;
  [[nodiscard]] SourceCounters counters() const noexcept override { return depth_->counters(); }
  [[nodiscard]] std::string_view detail() const noexcept override { return depth_->detail(); }
  [[nodiscard]] std::optional<ImageSize> size() const noexcept override { return depth_->size(); }
  [[nodiscard]] std::optional<Instant> came() const noexcept override { return depth_->came(); }
  [[nodiscard]] std::optional<std::uint64_t> length() const noexcept override {
    return depth_->length();
  }

 private:
  std::unique_ptr<DepthSource> depth_;
  GrayCamera& gray_;
  const GrayCameraOptions options_;
  std::vector<std::uint8_t> pixels_;
  StampClock clock_;
  MonotonicClock monotonic_;
};

}  // namespace maplet
