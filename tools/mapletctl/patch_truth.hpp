// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "core/geometry/plane.hpp"
#include "core/ports/depth_source.hpp"

namespace maplet::ctl {

/// The true plane of each pixel of a source's frames.
class PatchTruth {
 public:
  virtual ~PatchTruth() = default;

  /// Of the frame that the source delivered last.
  /// @return a label a pixel, 0 = none; valid until the next call. Throws Failure when the truth is
  ///   there and cannot be read.
  [[nodiscard]] virtual std::span<const std::uint16_t> labels(const DepthFrame& frame) = 0;
  /// In the camera's frame, of the frame that labels() was called with; nothing when it is not
  /// told.
  [[nodiscard]] virtual std::optional<Plane> plane(std::uint16_t label) const = 0;

  /// A simulator knows its own; a recording has it as `mapletctl simulate` writes it: labels/ with
  /// an image for each line of depth.txt, NNNNNN.png counted from 0, and planes.jsonl.
  /// @return nullptr when there is none
  [[nodiscard]] static std::unique_ptr<PatchTruth> of(const std::string& uri,
                                                      const DepthSource& source);
};

}  // namespace maplet::ctl
