// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/motion_files.hpp"

#include "tests/fuzz/fuzz.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace maplet;
  MotionFiles files;
  files.parse_odometry(fuzz::text(data, size));
  files.parse_gyro(fuzz::text(data, size));
  for (const double s : {0.0, 1.0, 1.05, 1305031102.2}) {
    const MotionHint hint = files.at(Stamp{static_cast<Stamp::rep>(s * 1e9)});
    fuzz::require(hint.T_external_camera.t.allFinite(), "a hint is finite");
    fuzz::require(hint.q_gyro_camera.coeffs().allFinite(), "a turn is finite");
  }
  return 0;
}
