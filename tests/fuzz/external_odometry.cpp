// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Reports of a publisher gone mad: whatever numbers they hold, what the tracker gets are numbers.
#include "daemon/external_odometry.hpp"

#include <cstring>
#include <memory>

#include "tests/fuzz/fuzz.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace maplet;
  using daemon::ExternalOdometry;
  // A kind, a stamp, seven numbers of the pose, one for each covariance.
  struct Raw {
    std::uint8_t kind;
    std::int16_t step_ms;
    double numbers[9];
  };
  constexpr std::size_t kBytes = 1 + 2 + 9 * 8;
  const auto external = std::make_unique<ExternalOdometry>(OdometryConfig{}, Se3{});
  Stamp stamp{};
  for (; size >= kBytes; data += kBytes, size -= kBytes) {
    Raw raw;
    raw.kind = data[0];
    std::memcpy(&raw.step_ms, data + 1, 2);
    std::memcpy(raw.numbers, data + 3, sizeof raw.numbers);
    stamp += std::chrono::milliseconds{raw.step_ms};
    OdometryReport report;
    report.stamp_ns = stamp.count();
    report.writer = raw.kind & 1U;
    report.t = {raw.numbers[0], raw.numbers[1], raw.numbers[2]};
    report.q = {raw.numbers[3], raw.numbers[4], raw.numbers[5], raw.numbers[6]};
    if ((raw.kind & 2U) != 0) report.q = {0.0, 0.0, 0.0, 1.0};
    report.covariance.diagonal().setConstant(raw.numbers[7]);
    report.twist_covariance.diagonal().setConstant(raw.numbers[8]);
    if ((raw.kind & 4U) != 0) report.twist_covariance.setConstant(raw.numbers[8]);
    external->take(report, stamp);
    const MotionHint hint = external->at(stamp);
    if ((raw.kind & 8U) != 0) external->tracked();
    fuzz::require(hint.T_external_camera.t.allFinite(), "a hint is finite");
    fuzz::require(hint.T_external_camera.q.coeffs().allFinite(), "a hint's turn is finite");
    fuzz::require(hint.path_covariance.allFinite(), "a hint's covariance is finite");
    fuzz::require(hint.path_covariance.diagonal().minCoeff() >= 0.0, "variances are none below 0");
  }
  return 0;
}
