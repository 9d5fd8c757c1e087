// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/odometry/pair_sums.hpp"

#include <Eigen/Cholesky>
#include <array>

namespace maplet {

namespace {

constexpr double kPairTailDof = 3.0;   // of the t-distribution of residuals
constexpr double kInlierChi2 = 16.27;  // 99.9 % of 3 degrees of freedom
constexpr std::size_t kEveryPair = 4;  // is asked for its noise
constexpr double kTiny = 1e-9;

double tail_weight(double chi2) noexcept {
  return (kPairTailDof + 3.0) / (kPairTailDof + chi2);  // eq. 4
}

// E[skew(x)^T w skew(x)] for x with second moment m.
Eigen::Matrix3d skew_moment(const Eigen::Matrix3d& m, const Eigen::Matrix3d& w) noexcept {
  const Eigen::Matrix3d product = m * w;
  return (m.trace() * w.trace() - product.trace()) * Eigen::Matrix3d::Identity() - w.trace() * m -
         m.trace() * w + product + product.transpose();
}

// The upper blocks of the normal equations, until they are put together.
struct Sums {
  Sym3 vv;
  Sym3 ww;
  Eigen::Matrix3d vw = Eigen::Matrix3d::Zero();
  Eigen::Vector3d bv = Eigen::Vector3d::Zero();
  Eigen::Vector3d bw = Eigen::Vector3d::Zero();

  void add(const FacetPair& pair, const PlaneMotion& motion) noexcept {
    const Eigen::Vector3d residual = pair.frame->theta - motion(pair.reference->theta);
    const Eigen::Vector3d wr = pair.weight * residual;
    const double weight = tail_weight(dot(residual, wr));
    // Eq. 5: the Jacobian of eq. 1 is [g g^T, [g]_x].
    const Eigen::Vector3d g = motion(pair.reference->surface);
    const Sym3 w = pair.weight * weight;
    const Eigen::Vector3d wg = w * g;
    const double along = dot(g, wg);
    const double x = along * g.x();
    const double y = along * g.y();
    const double z = along * g.z();
    vv = vv + Sym3{x * g.x(), x * g.y(), x * g.z(), y * g.y(), y * g.z(), z * g.z()};
    const Eigen::Vector3d c = wg.cross(g);
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) vw(i, j) += g[i] * c[j];
    }
    ww = ww + cross_congruence(g, w);
    bv += g * dot(wg, residual);
    bw += weight * wr.cross(g);
  }

  [[nodiscard]] NormalEquations equations() const noexcept {
    NormalEquations out;
    out.information << vv.matrix(), vw, vw.transpose(), ww.matrix();
    out.gradient << bv, bw;
    return out;
  }
};

}  // namespace

double PairEvidence::disagreement(const NormalEquations& prior) const noexcept {
  if (fresh.information.isZero(0.0)) return 0.0;
  const Eigen::LDLT<Matrix6d> without{known.information + prior.information};
  const Vector6d step = without.solve(known.gradient + prior.gradient);
  const Vector6d pull = fresh.gradient - fresh.information * step;
  const Matrix6d expected =
      fresh.information + fresh.information * without.solve(fresh.information);
  const Vector6d scale = expected.diagonal().cwiseMax(kTiny).cwiseSqrt().cwiseInverse();
  Matrix6d scaled = scale.asDiagonal() * expected * scale.asDiagonal();
  scaled.diagonal().array() += kTiny;
  const Vector6d whitened = scale.cwiseProduct(pull);
  return whitened.dot(scaled.ldlt().solve(whitened)) / 6.0;
}

PairEvidence evidence_of(std::span<const FacetPair> pairs, const PlaneMotion& motion) noexcept {
  std::array<Sums, 2> sums;
  for (const FacetPair& pair : pairs) sums[pair.reference->fresh ? 1 : 0].add(pair, motion);
  return {sums[0].equations(), sums[1].equations()};
}

Matrix6d spurious_information(std::span<const FacetPair> pairs, const PlaneMotion& motion,
                              double trust) noexcept {
  Matrix6d out = Matrix6d::Zero();
  for (std::size_t i = 0; i < pairs.size(); i += kEveryPair) {
    const FacetPair& pair = pairs[i];
    const Eigen::Vector3d q = times(motion.R, pair.reference->surface);
    const double s = 1.0 + dot(q, motion.p);
    const Eigen::Vector3d t = q / s;
    const Eigen::Matrix3d J = (motion.R - t * (motion.p.transpose() * motion.R)) / s;
    const Eigen::Matrix3d moment = congruence(J, pair.reference->surface_covariance).matrix();
    const Sym3 weight = pair.weight * (pair.reference->fresh ? trust : 1.0);
    out.topLeftCorner<3, 3>() += dot(t, weight * t) * moment;
    out.bottomRightCorner<3, 3>() += skew_moment(moment, weight.matrix());
  }
  return static_cast<double>(kEveryPair) * out;
}

PairVerdict judge_pairs(std::span<const FacetPair> pairs, const PlaneMotion& motion, double trust,
                        ScoreBlocks* blocks) noexcept {
  PairVerdict out;
  for (const FacetPair& pair : pairs) {
    const Eigen::Vector3d residual = pair.frame->theta - motion(pair.reference->theta);
    const Eigen::Vector3d wr = pair.weight * residual;
    const double chi2 = dot(residual, wr);
    if (blocks != nullptr) {
      const double weight = (pair.reference->fresh ? trust : 1.0) * tail_weight(chi2);
      const Eigen::Vector3d g = motion(pair.reference->surface);
      Vector6d score;
      score << g * (weight * dot(wr, g)), weight * wr.cross(g);
      blocks->add(pair.frame->block, score);
    }
    if (chi2 > kInlierChi2) continue;
    out.chi2 += chi2;
    out.pixels += pair.frame->pixels;
    ++out.inliers;
  }
  return out;
}

}  // namespace maplet
