// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "core/base/deadline.hpp"
#include "core/base/expected.hpp"
#include "core/frame/depth_frame.hpp"
#include "core/frame/image_size.hpp"

namespace maplet {

/// What a source lost or refused so far. Nothing is skipped silently.
struct SourceCounters {
  std::uint64_t read = 0;          ///< frames delivered
  std::uint64_t dropped = 0;       ///< frames that came too fast (live)
  std::uint64_t unreadable = 0;    ///< truncated or damaged images, wrong size
  std::uint64_t out_of_order = 0;  ///< stamps that did not go forward: skipped
};

/// A depth camera. drivers/ implements it; core/ never sees OpenNI2.
///
/// Threads  one caller at a time.
class DepthSource {
 public:
  virtual ~DepthSource() = default;

  /// Waits for a frame; its pixels are on loan until the next call.
  /// @return the frame, or kTimeout (retry), kDevice (reopen), kEnd (recording over). A damaged
  ///   frame is counted, said through detail(), and skipped.
  [[nodiscard]] virtual Expected<DepthFrame> next(Deadline deadline) noexcept = 0;

  [[nodiscard]] virtual SourceCounters counters() const noexcept = 0;

  /// The latest problem in words, with file or device; empty when there was none. Valid until the
  /// next call of next().
  [[nodiscard]] virtual std::string_view detail() const noexcept { return {}; }

  /// When the device's runtime had the frame that next() gave last, on the monotonic clock; nothing
  /// where that is not known.
  [[nodiscard]] virtual std::optional<Instant> came() const noexcept { return {}; }

  /// How many frames the recording holds, where that is known.
  [[nodiscard]] virtual std::optional<std::uint64_t> length() const noexcept { return {}; }

  /// The size of its depth images, where it is known before the first one.
  [[nodiscard]] virtual std::optional<ImageSize> size() const noexcept { return {}; }
};

}  // namespace maplet
