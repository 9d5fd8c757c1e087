// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/maplet/quantise.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace maplet::codec {

namespace {

constexpr int kRotationBits = 18;
constexpr double kRotationScale = (1 << (kRotationBits - 1)) - 1;
constexpr double kSmallestSigma = 1e-6;
constexpr double kSigmaStepsPerOctave = 12.0;
constexpr double kCorrelationScale = 127.0;

double sign_of(double x) noexcept { return x < 0.0 ? -1.0 : 1.0; }

// Positive definite by a margin: the decoded matrix is inverted.
bool consistent(const double (&c)[3]) noexcept {
  const double determinant =
      1.0 + 2.0 * c[0] * c[1] * c[2] - c[0] * c[0] - c[1] * c[1] - c[2] * c[2];
  return std::abs(c[0]) < 1.0 && std::abs(c[1]) < 1.0 && std::abs(c[2]) < 1.0 && determinant > 1e-6;
}

}  // namespace

std::uint64_t pack_rotation(const Eigen::Quaterniond& q) noexcept {
  const Eigen::Vector4d c = q.normalized().coeffs();
  Eigen::Index largest = 0;
  c.cwiseAbs().maxCoeff(&largest);
  const double sign = sign_of(c[largest]);
  auto code = static_cast<std::uint64_t>(largest);
  int shift = 2;
  for (Eigen::Index i = 0; i < 4; ++i) {
    if (i == largest) continue;
    const auto part = std::lround(sign * c[i] * std::numbers::sqrt2 * kRotationScale);
    code |= (static_cast<std::uint64_t>(part) & ((1U << kRotationBits) - 1)) << shift;
    shift += kRotationBits;
  }
  return code;
}

bool unpack_rotation(std::uint64_t code, Eigen::Quaterniond& q) noexcept {
  const auto largest = static_cast<Eigen::Index>(code & 3U);
  double squares = 0.0;
  int shift = 2;
  for (Eigen::Index i = 0; i < 4; ++i) {
    if (i == largest) continue;
    const auto bits = static_cast<std::uint32_t>(code >> shift) << (32 - kRotationBits);
    const int part = static_cast<std::int32_t>(bits) >> (32 - kRotationBits);
    q.coeffs()[i] = part / (std::numbers::sqrt2 * kRotationScale);
    squares += q.coeffs()[i] * q.coeffs()[i];
    shift += kRotationBits;
  }
  if (squares > 0.76) return false;  // the largest of four has at least 1/4
  q.coeffs()[largest] = std::sqrt(1.0 - squares);
  return true;
}

PackedCovariance pack_covariance(const Eigen::Matrix3d& covariance) noexcept {
  PackedCovariance out{};
  double sigma[3];
  for (int i = 0; i < 3; ++i) {
    sigma[i] = std::sqrt(std::max(covariance(i, i), kSmallestSigma * kSmallestSigma));
    const double steps = std::ceil(kSigmaStepsPerOctave * std::log2(sigma[i] / kSmallestSigma));
    out.log_sigma[i] = static_cast<std::uint8_t>(std::clamp(steps, 0.0, 255.0));
  }
  double c[3] = {covariance(0, 1) / (sigma[0] * sigma[1]), covariance(0, 2) / (sigma[0] * sigma[2]),
                 covariance(1, 2) / (sigma[1] * sigma[2])};
  double quantised[3];
  do {  // nearly singular ones lose a little correlation
    for (int i = 0; i < 3; ++i) {
      out.correlation[i] =
          static_cast<std::int8_t>(std::trunc(std::clamp(c[i], -0.995, 0.995) * kCorrelationScale));
      quantised[i] = out.correlation[i] / kCorrelationScale;
      c[i] *= 0.98;
    }
  } while (!consistent(quantised));
  return out;
}

bool unpack_covariance(const PackedCovariance& packed, Eigen::Matrix3d& covariance) noexcept {
  double c[3];
  for (int i = 0; i < 3; ++i) c[i] = packed.correlation[i] / kCorrelationScale;
  if (!consistent(c)) return false;
  Eigen::Vector3d sigma;
  for (int i = 0; i < 3; ++i) {
    sigma[i] = kSmallestSigma * std::exp2(packed.log_sigma[i] / kSigmaStepsPerOctave);
  }
  Eigen::Matrix3d correlation;
  correlation << 1.0, c[0], c[1], c[0], 1.0, c[2], c[1], c[2], 1.0;
  covariance = sigma.asDiagonal() * correlation * sigma.asDiagonal();
  return true;
}

}  // namespace maplet::codec
