// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/camera_toml.hpp"

#include <cmath>

#include "core/limits.hpp"
#include "tests/fuzz/fuzz.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace maplet;
  const auto gray = parse_gray_toml(fuzz::text(data, size), "camera.toml");
  if (!gray) {
    fuzz::require_one_line(gray.error());
  } else if (*gray) {
    fuzz::require((*gray)->camera.valid(), "a gray camera that is taken is valid");
    fuzz::require(std::abs((*gray)->T_depth_gray.q.norm() - 1.0) < 1e-9, "its turn is a turn");
  }
  const auto camera = parse_camera_toml(fuzz::text(data, size), "camera.toml");
  if (!camera) {
    fuzz::require_one_line(camera.error());
    return 0;
  }
  fuzz::require(camera->camera.valid(), "a camera that is taken is valid");
  fuzz::require(camera->camera.width_px <= static_cast<int>(kMaxWidthPx) &&
                    camera->camera.height_px <= static_cast<int>(kMaxHeightPx),
                "its size is within the limits");
  fuzz::require(camera->metres_per_unit > 0.0, "its unit is positive");
  return 0;
}
