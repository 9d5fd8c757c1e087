// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/autopilot_record.hpp"

#include <Eigen/Eigenvalues>
#include <bit>
#include <cmath>
#include <limits>

#include "core/base/crc.hpp"
#include "transport/exchange/byte_io.hpp"

namespace maplet::daemon {

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

class Writer {
 public:
  explicit Writer(std::span<std::byte> out) noexcept : out_{out} {}
  void number(std::uint64_t value, std::size_t bytes) noexcept { out_.fixed(value, bytes); }
  void f32(double value) noexcept {
    out_.fixed(std::bit_cast<std::uint32_t>(static_cast<float>(value)), 4);
  }
  void f64(double value) noexcept { out_.fixed(std::bit_cast<std::uint64_t>(value), 8); }
  void pose(const Se3& T) noexcept {
    for (int i = 0; i < 3; ++i) f64(T.t[i]);
    for (int i = 0; i < 4; ++i) f32(T.q.coeffs()[i]);
  }
  void upper(const Matrix6d& m) noexcept {
    for (int i = 0; i < 6; ++i)
      for (int j = i; j < 6; ++j) f32(m(i, j));
  }

 private:
  ByteWriter out_;
};

float worst_sigma(const Eigen::Matrix3d& covariance) noexcept {
  if (!covariance.allFinite()) return kInfinity;
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen;
  eigen.computeDirect(covariance, Eigen::EigenvaluesOnly);
  return static_cast<float>(std::sqrt(std::max(0.0, eigen.eigenvalues()[2])));
}

}  // namespace

AutopilotBytes to_bytes(const AutopilotRecord& r) noexcept {
  AutopilotBytes bytes{};
  Writer out{bytes};
  const bool tracking = (r.flags & AutopilotRecord::kTracking) != 0;
  const bool moves = (r.flags & AutopilotRecord::kMoves) != 0;
  Matrix6d R = Matrix6d::Zero();  // from the body's tangent to the frame's fixed axes
  R.topLeftCorner<3, 3>() = R.bottomRightCorner<3, 3>() = r.pose.T_odom_base.rotation();
  const Matrix6d nothing = Matrix6d::Constant(kNan);
  const Matrix6d covariance = tracking ? Matrix6d{R * r.pose.covariance * R.transpose()} : nothing;
  for (const char c : AutopilotRecord::kMagic) out.number(static_cast<std::uint8_t>(c), 1);
  out.number(AutopilotRecord::kVersion, 1);
  out.number(static_cast<std::uint8_t>(r.frame), 1);
  out.number(r.flags, 1);
  out.number(r.reset_counter, 1);
  out.number(AutopilotRecord::kBytes, 2);
  out.number(r.agent, 2);
  out.number(r.sequence, 4);
  out.number(static_cast<std::uint64_t>(r.stamp_ns), 8);
  out.number(r.age_us, 4);
  out.f32(tracking ? worst_sigma(covariance.topLeftCorner<3, 3>()) : kInfinity);
  out.f32(tracking ? worst_sigma(covariance.bottomRightCorner<3, 3>()) : kInfinity);
  out.number(r.map_jumps, 4);
  out.pose(r.pose.T_odom_base);
  for (int i = 0; i < 6; ++i) out.f32(moves ? r.pose.twist[i] : kNan);
  out.upper(covariance);
  out.upper(moves ? r.pose.twist_covariance : nothing);
  out.pose(r.pose.T_map_odom);
  const std::span all{bytes};
  const std::uint32_t crc = crc32c(all.first(AutopilotRecord::kBytes - 4));
  Writer{all.last(4)}.number(crc, 4);
  return bytes;
}

}  // namespace maplet::daemon
