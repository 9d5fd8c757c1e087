// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <tl/expected.hpp>

#include "core/base/static_vector.hpp"
#include "core/frame/noise_model.hpp"
#include "core/geometry/camera_model.hpp"
#include "core/ports/depth_source.hpp"

namespace maplet {

inline constexpr std::size_t kMaxInvalidValues = 8;
using InvalidValues = StaticVector<std::uint16_t, kMaxInvalidValues>;

/// What the configuration knows of the camera and wants from the source.
struct SourceOptions {
  /// Of the depth image. Not valid(): the source has to know. A recording's camera.toml goes before
  /// it, a device's nominal field of view after it.
  CameraModel camera;
  double metres_per_unit = 0.001;     ///< goes with `camera`
  InvalidValues invalid_values;       ///< depth values that mean "no return", besides 0
  bool registered_to_colour = false;  ///< goes with `camera`: gray has the viewpoint of depth
  bool gray = true;                   ///< deliver gray where it is registered to depth
  NoiseModel noise;                   ///< travels with every frame
  bool noise_given = false;           ///< it is said, not a typical one: a simulator takes it too
};

/// Why a source did not open.
struct SourceError {
  enum class Kind : std::uint8_t {
    kUsage,   ///< the URI makes no sense: exit code 2
    kAbsent,  ///< the device is not there: it may come later
    kBad,     ///< the input is there and of no use, or a file is missing
  };
  Kind kind;
  std::string what;  ///< one line: what, where, remedy
};

using OpenedSource = tl::expected<std::unique_ptr<DepthSource>, SourceError>;

[[nodiscard]] inline tl::unexpected<SourceError> source_error(SourceError::Kind kind,
                                                              std::string what) {
  return tl::unexpected<SourceError>{SourceError{kind, std::move(what)}};
}

}  // namespace maplet
