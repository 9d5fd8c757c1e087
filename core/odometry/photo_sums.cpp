// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/odometry/photo_sums.hpp"

#include <cmath>

namespace maplet {

namespace {

using Points = PhotoVariant::Points;

IntensitySums intensities(const PhotoLook& look, Points points, const Brightness& by) noexcept {
  IntensitySums s;
  look.visit(points, [&](const PhotoPoint& point, float intensity, auto&&...) {
    const float w = photo_weight(intensity - by.gain * point.intensity - by.offset, by.sigma);
    s.n += w;
    s.x += w * point.intensity;
    s.y += w * intensity;
    s.xx += w * point.intensity * point.intensity;
    s.xy += w * point.intensity * intensity;
  });
  return s;
}

SpreadSums spread(const PhotoLook& look, Points points, const Brightness& by) noexcept {
  SpreadSums s;
  look.visit(points, [&](const PhotoPoint& point, float intensity, auto&&...) {
    const float residual = intensity - by.gain * point.intensity - by.offset;
    s.squared += photo_weight(residual, by.sigma) * residual * residual;
    s.count += 1.0F;
  });
  return s;
}

PhotoEquations equations(const PhotoLook& look, Points points, const Brightness& by) noexcept {
  PhotoEquations out;
  look.visit(points, [&](const PhotoPoint& point, float intensity, const Eigen::Vector3f& slope,
                         const Eigen::Vector3f& p, float, float) {
    const float residual = intensity - by.gain * point.intensity - by.offset;
    const float w = photo_weight(residual, by.sigma);
    Eigen::Matrix<float, 6, 1> J;  // of minus the residual
    J.head<3>() = slope;
    J.tail<3>() = p.cross(slope);
    const Eigen::Matrix<float, 6, 1> wJ = w * J;
    out.H.triangularView<Eigen::Lower>() += wJ * J.transpose();
    out.b += wJ * residual;
    ++out.seen;
    if (std::abs(residual) < kPhotoKeptSigmas * by.sigma) ++out.kept;
  });
  return out;
}

}  // namespace

const PhotoVariant kPhotoPlain{"plain", intensities, spread, equations};

}  // namespace maplet
