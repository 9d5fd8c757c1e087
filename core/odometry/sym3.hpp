// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace maplet {

/// A symmetric 3 x 3 matrix in six numbers, for the inner loops of the alignment.
struct Sym3 {
  double xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;

  [[nodiscard]] static Sym3 of(const Eigen::Matrix3d& m) noexcept {
    return {m(0, 0), m(0, 1), m(0, 2), m(1, 1), m(1, 2), m(2, 2)};
  }
  [[nodiscard]] Eigen::Matrix3d matrix() const noexcept {
    Eigen::Matrix3d m;
    m << xx, xy, xz, xy, yy, yz, xz, yz, zz;
    return m;
  }
  [[nodiscard]] Eigen::Vector3d operator*(const Eigen::Vector3d& v) const noexcept {
    return {xx * v.x() + xy * v.y() + xz * v.z(), xy * v.x() + yy * v.y() + yz * v.z(),
            xz * v.x() + yz * v.y() + zz * v.z()};
  }
  [[nodiscard]] Sym3 operator*(double s) const noexcept {
    return {xx * s, xy * s, xz * s, yy * s, yz * s, zz * s};
  }
  [[nodiscard]] Sym3 operator+(const Sym3& o) const noexcept {
    return {xx + o.xx, xy + o.xy, xz + o.xz, yy + o.yy, yz + o.yz, zz + o.zz};
  }
  [[nodiscard]] double trace() const noexcept { return xx + yy + zz; }

  /// Zero determinants give infinities: the caller adds what keeps it regular.
  [[nodiscard]] Sym3 inverse() const noexcept {
    const double a = yy * zz - yz * yz;
    const double b = xz * yz - xy * zz;
    const double c = xy * yz - xz * yy;
    const double s = 1.0 / (xx * a + xy * b + xz * c);
    return {a * s,
            b * s,
            c * s,
            (xx * zz - xz * xz) * s,
            (xy * xz - xx * yz) * s,
            (xx * yy - xy * xy) * s};
  }
};

/// a . b
[[nodiscard]] inline double dot(const Eigen::Vector3d& a, const Eigen::Vector3d& b) noexcept {
  return a.x() * b.x() + a.y() * b.y() + a.z() * b.z();
}

[[nodiscard]] inline Eigen::Vector3d times(const Eigen::Matrix3d& m,
                                           const Eigen::Vector3d& v) noexcept {
  return {m(0, 0) * v.x() + m(0, 1) * v.y() + m(0, 2) * v.z(),
          m(1, 0) * v.x() + m(1, 1) * v.y() + m(1, 2) * v.z(),
          m(2, 0) * v.x() + m(2, 1) * v.y() + m(2, 2) * v.z()};
}

/// A s A^T
[[nodiscard]] inline Sym3 congruence(const Eigen::Matrix3d& A, const Sym3& s) noexcept {
  const Eigen::Vector3d a{A(0, 0), A(0, 1), A(0, 2)};
  const Eigen::Vector3d b{A(1, 0), A(1, 1), A(1, 2)};
  const Eigen::Vector3d c{A(2, 0), A(2, 1), A(2, 2)};
  const Eigen::Vector3d sa = s * a;
  const Eigen::Vector3d sb = s * b;
  const Eigen::Vector3d sc = s * c;
  return {dot(a, sa), dot(a, sb), dot(a, sc), dot(b, sb), dot(b, sc), dot(c, sc)};
}

/// [g]_x^T W [g]_x
[[nodiscard]] inline Sym3 cross_congruence(const Eigen::Vector3d& g, const Sym3& w) noexcept {
  const double x = g.x();
  const double y = g.y();
  const double z = g.z();
  return {z * z * w.yy - 2.0 * y * z * w.yz + y * y * w.zz,
          -z * z * w.xy + x * z * w.yz + y * z * w.xz - x * y * w.zz,
          y * z * w.xy - x * z * w.yy - y * y * w.xz + x * y * w.yz,
          z * z * w.xx - 2.0 * x * z * w.xz + x * x * w.zz,
          -y * z * w.xx + x * z * w.xy + x * y * w.xz - x * x * w.yz,
          y * y * w.xx - 2.0 * x * y * w.xy + x * x * w.yy};
}

}  // namespace maplet
