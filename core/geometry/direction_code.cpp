// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/geometry/direction_code.hpp"

#include <algorithm>
#include <cmath>

namespace maplet {

namespace {

constexpr double kOctahedral = 32767.0;

double sign_of(double x) noexcept { return x < 0.0 ? -1.0 : 1.0; }

}  // namespace

std::uint32_t pack_direction(const Eigen::Vector3d& n) noexcept {
  const double scale = 1.0 / n.lpNorm<1>();
  double a = n.x() * scale;
  double b = n.y() * scale;
  if (n.z() < 0.0) {
    const double folded = (1.0 - std::abs(b)) * sign_of(a);
    b = (1.0 - std::abs(a)) * sign_of(b);
    a = folded;
  }
  const auto code = [](double x) {
    return static_cast<std::uint16_t>(static_cast<std::int16_t>(std::lround(x * kOctahedral)));
  };
  return code(a) | (static_cast<std::uint32_t>(code(b)) << 16);
}

Eigen::Vector3d unpack_direction(std::uint32_t code) noexcept {
  const auto part = [](std::uint32_t bits) {
    return std::max(static_cast<std::int16_t>(bits & 0xFFFFU) / kOctahedral, -1.0);
  };
  Eigen::Vector3d n{part(code), part(code >> 16), 0.0};
  n.z() = 1.0 - std::abs(n.x()) - std::abs(n.y());
  if (n.z() < 0.0) {
    const double unfolded = (1.0 - std::abs(n.y())) * sign_of(n.x());
    n.y() = (1.0 - std::abs(n.x())) * sign_of(n.y());
    n.x() = unfolded;
  }
  return n.normalized();
}

}  // namespace maplet
