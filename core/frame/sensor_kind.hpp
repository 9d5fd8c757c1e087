// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

#include "core/frame/noise_model.hpp"

namespace maplet {

/// What measures the depth: decides which noise model is typical.
enum class SensorKind : std::uint8_t { kStructuredLight, kStereo, kTimeOfFlight };

inline constexpr std::array<std::string_view, 3> kSensorKindNames{"structured_light", "stereo",
                                                                  "tof"};

[[nodiscard]] constexpr std::optional<SensorKind> sensor_kind(std::string_view name) noexcept {
  for (std::size_t i = 0; i < kSensorKindNames.size(); ++i) {
    if (kSensorKindNames[i] == name) return static_cast<SensorKind>(i);
  }
  return std::nullopt;
}

/// The noise model of a typical sensor: Kinect v1; an active stereo head of 5 cm baseline, 420 px
/// focal length and 0.08 px of disparity noise in steps of 1/32 px, matched over 5 x 5 pixels (k =
/// sigma of disparity / (focal length * baseline)); Kinect v2.
[[nodiscard]] constexpr NoiseModel typical_noise(SensorKind kind) noexcept {
  NoiseModel model;  // Kinect v1
  if (kind == SensorKind::kStereo) {
    model.disparity_k = 3.8e-3;
    model.correlated_px = 16.0;
    model.disparity_step = 1.5e-3;
  }
  if (kind == SensorKind::kTimeOfFlight) {
    model.disparity_step = 0.0;
    model.kind = NoiseModel::Kind::kTimeOfFlight;
    model.correlated_px = 2.0;
  }
  return model;
}

}  // namespace maplet
