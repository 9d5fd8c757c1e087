// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/exchange/delta_pose_record.hpp"

#include <algorithm>
#include <cmath>

namespace maplet {

namespace {

constexpr double kTranslationUnit = 0x1p-14;  // m
constexpr double kRotationUnit = 0x1p-21;     // rad
constexpr double kSteps = 0x1p23;             // a signed 24-bit number on the radio
constexpr double kMaxAngle = 3.1416;          // a little over pi: the grid may round up

float on_grid(double value, double unit) noexcept {
  return static_cast<float>(std::nearbyint(value / unit) * unit);
}

// In a plane: right, forward and the turn about down, of six.
constexpr std::array<int, 3> kInPlane{0, 2, 4};

// As if the camera stood level: what the record of a motion in a plane holds. eq. 5
Se3 level(const PlanarMotion& planar, const Se3& T) noexcept {
  return PlanarMotion{Eigen::Vector3d{0.0, -1.0, 0.0}}.at(planar.coordinates(T));
}

Matrix6d level(const PlanarMotion& planar, const Matrix6d& covariance) noexcept {
  const Eigen::Matrix3d inside = planar.basis().transpose() * covariance * planar.basis();
  Matrix6d out = Matrix6d::Zero();
  out.diagonal().setConstant(PlanarMotion::kTold * PlanarMotion::kTold);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) out(kInPlane[i], kInPlane[j]) = inside(i, j);
  }
  return out;
}

bool says_only_the_plane(const DeltaPoseRecord& record) noexcept {
  const CovarianceCode& code = record.covariance;
  bool only = record.translation_m[1] == 0.0F && record.rotation_rad[0] == 0.0F &&
              record.rotation_rad[2] == 0.0F;
  std::size_t shape = 0;
  for (std::size_t row = 0; row < 6; ++row) {
    for (std::size_t column = 0; column < row; ++column, ++shape) {
      only = only && (code.shape[shape] == 0 || (in_plane(row) && in_plane(column)));
    }
    if (in_plane(row)) continue;
    only = only && code.sigma[row] == static_cast<float>(PlanarMotion::kTold) &&
           code.pivot[row - 1] == 0;
  }
  return only;
}

bool is_on_grid(float value, double unit) noexcept {
  return std::abs(value) < kSteps * unit && on_grid(value, unit) == value;
}

}  // namespace

Expected<DeltaPoseRecord> quantise(const DeltaPose& delta, std::uint16_t agent, std::uint32_t epoch,
                                   std::uint32_t seq) noexcept {
  Se3 T = delta.T_a_b.se3;
  if (!T.t.allFinite() || !T.q.coeffs().allFinite() || !std::isfinite(delta.overlap)) {
    return fail(ErrorCode::kBadInput, "delta-pose is not finite");
  }
  if (T.t.cwiseAbs().maxCoeff() >= (kSteps - 1) * kTranslationUnit) {
    return fail(ErrorCode::kBadInput, "delta-pose is longer than 512 m");
  }
  Matrix6d spread = delta.covariance;
  if (delta.plane != PlaneCode::kSpace) {
    const PlanarMotion planar{delta.plane};
    T = level(planar, T);
    spread = level(planar, spread);
  }
  const auto covariance = encode_covariance(spread);
  if (!covariance) return tl::unexpected{covariance.error()};

  DeltaPoseRecord record;
  record.key = {agent, epoch, stream_of(delta.kind), seq};
  record.kind = delta.kind;
  record.a = delta.a;
  record.b = delta.b;
  record.stamp_a = delta.stamp_a;
  record.stamp_b = delta.stamp_b;
  const Eigen::Vector3d rotation = Se3{T.q.normalized(), Eigen::Vector3d::Zero()}.log().tail<3>();
  for (int i = 0; i < 3; ++i) {
    record.translation_m[i] = on_grid(T.t[i], kTranslationUnit);
    record.rotation_rad[i] = on_grid(rotation[i], kRotationUnit);
  }
  record.covariance = *covariance;
  record.plane = delta.plane;
  record.overlap =
      static_cast<std::uint8_t>(std::lround(std::clamp(delta.overlap, 0.0F, 1.0F) * 255.0F));
  record.matches = static_cast<std::uint8_t>(std::min<std::uint16_t>(delta.matches, 255));
  return record;
}

DeltaPose restore(const DeltaPoseRecord& record) noexcept {
  Vector6d rotation = Vector6d::Zero();
  for (int i = 0; i < 3; ++i) rotation[3 + i] = record.rotation_rad[i];
  DeltaPose delta;
  delta.kind = record.kind;
  delta.a = record.a;
  delta.b = record.b;
  delta.stamp_a = record.stamp_a;
  delta.stamp_b = record.stamp_b;
  delta.T_a_b.se3.q = Se3::exp(rotation).q;
  for (int i = 0; i < 3; ++i) delta.T_a_b.se3.t[i] = record.translation_m[i];
  delta.covariance = decode_covariance(record.covariance);
  delta.plane = record.plane;
  if (record.plane != PlaneCode::kSpace) {
    const PlanarMotion planar{record.plane};
    delta.T_a_b.se3 =
        planar.at({record.translation_m[0], record.translation_m[2], record.rotation_rad[1]});
    delta.covariance = planar.widen(delta.covariance(kInPlane, kInPlane), PlanarMotion::kTold);
  }
  delta.overlap = static_cast<float>(record.overlap) / 255.0F;
  delta.matches = record.matches;
  return delta;
}

bool valid(const DeltaPoseRecord& record) noexcept {
  double angle_squared = 0.0;
  for (int i = 0; i < 3; ++i) {
    if (!is_on_grid(record.translation_m[i], kTranslationUnit)) return false;
    if (!is_on_grid(record.rotation_rad[i], kRotationUnit)) return false;
    angle_squared += double{record.rotation_rad[i]} * record.rotation_rad[i];
  }
  return angle_squared <= kMaxAngle * kMaxAngle && record.kind <= DeltaPose::Kind::kClosure &&
         record.key.stream == stream_of(record.kind) && record.a != record.b &&
         valid(record.covariance) && valid(record.plane) &&
         (record.plane == PlaneCode::kSpace || says_only_the_plane(record));
}

}  // namespace maplet
