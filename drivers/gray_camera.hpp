// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "core/base/clock.hpp"
#include "core/geometry/camera_model.hpp"
#include "core/geometry/se3.hpp"
#include "drivers/line.hpp"

namespace maplet {

/// What the configuration wants of a gray camera beside the depth camera.
struct GrayCameraOptions {
  std::string id;      ///< empty: the first one
  CameraModel camera;  ///< size and intrinsics
  Se3 T_depth_gray;
  double rate_hz = 30.0;
  Duration tolerance = std::chrono::milliseconds{20};  ///< between the stamps of a pair
  Duration depth_delay{};     ///< that depth frames have on their way here, more than the quickest
  Duration exposure{};        ///< 0 = automatic
  Duration exposure_limit{};  ///< of the automatic one; 0 = the time between two frames
  double gain = 1.0;          ///< with a fixed exposure
};

/// A gray camera of its own. It opens by itself, again and again, and is done without meanwhile.
///
/// Threads  nearest() by one, the rest by any.
class GrayCamera {
 public:
  virtual ~GrayCamera() = default;

  /// Copies the image whose stamp is nearest to `at`.
  /// @param at         on the monotonic clock
  /// @param patience   to wait for a later image than there is
  /// @param to         room for a whole image
  /// @return its stamp; nothing: none is within `tolerance`
  [[nodiscard]] virtual std::optional<Instant> nearest(Instant at, Duration tolerance,
                                                       Duration patience,
                                                       std::span<std::uint8_t> to) noexcept = 0;
  [[nodiscard]] virtual bool running() const noexcept = 0;
  [[nodiscard]] virtual std::uint64_t images() const noexcept = 0;
  /// How it is, in a line for people.
  [[nodiscard]] virtual Line state() const noexcept = 0;

  std::atomic<std::uint64_t> paired{0};  ///< depth frames that had an image
  std::atomic<std::uint64_t> alone{0};   ///< and those that had none
};

/// Starts one through libcamera. @return why this build has no libcamera
[[nodiscard]] tl::expected<std::unique_ptr<GrayCamera>, std::string> open_libcamera(
    const GrayCameraOptions& options);

/// The cameras that libcamera sees now: "ID (model)". @return why there is no libcamera
[[nodiscard]] tl::expected<std::vector<std::string>, std::string> libcamera_cameras();

}  // namespace maplet
