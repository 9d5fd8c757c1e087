// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/patches/step_bias.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace maplet {

namespace {

constexpr double kPi = std::numbers::pi;
/// Of its noise, below which a surface's wave is left out.
constexpr double kLeastShare = 0.05;
/// Of a wave's energy in a plane, what is spread over all its parameters.
constexpr double kAlikeShare = 0.75;
/// A step of so much is no sensor's.
constexpr double kMostSteps = 1e9;
/// Shares of a step and of a unit's rounding error that remain however many pixels are summed:
/// beats of steps with units, and with the image's edges. Measured on random rooms of boxes.
constexpr double kStepResidue = 0.002;
constexpr double kUnitResidue = 0.05;

double sinc(double half_phase) noexcept {
  return std::abs(half_phase) < 1e-3 ? 1.0 : std::sin(half_phase) / half_phase;
}

}  // namespace

StepBias::StepBias(double step, double variance, double unit_m) noexcept {
  const double unit = unit_m / kInverseDepthSteps;  // times w^2: a unit of depth, steps
  const double unit_variance = unit * unit / 12.0;
  unit_residue_ = kUnitResidue * kUnitResidue * unit_variance;
  if (!(step > 0.0 && step < kMostSteps)) return;
  radians_per_w_ = 2.0 * kPi / step;
  // Eq. 20: the first harmonic of rounding, dithered by noise of the rest of the variance.
  const double dither = std::max(0.0, variance / (step * step) - 1.0 / 12.0);
  const double amplitude = step / kPi * std::exp(-2.0 * kPi * kPi * dither);
  rounding_power_ = 0.5 * amplitude * amplitude;
  // Rounding to units of depth errs anew at each step: noise of several steps averages it.
  unit_power_ = unit_variance / (1.0 + 12.0 * dither);
  residue_ = kStepResidue * kStepResidue * step * step;
}

double StepBias::power(double w) const noexcept {
  return rounding_power_ + unit_power_ * w * w * w * w;
}

double StepBias::residue(double w) const noexcept {
  return residue_ + unit_residue_ * w * w * w * w;
}

bool StepBias::matters(const Fit& surface, const Moments& m, double noise_power) const noexcept {
  // Squared sum of the wave along a surface whose phases have this variance, at most.
  constexpr double kPerVariance = 6.0;
  const double spread =
      surface.a * (m.uw - m.u * surface.w0) + surface.b * (m.vw - m.v * surface.w0);
  const double phases = radians_per_w_ * radians_per_w_ * spread / m.n;
  return power(surface.w0) * m.n > kLeastShare * noise_power * (1.0 + kPerVariance * phases);
}

void StepBias::add(const Fit& surface, const Moments& part, double width_px, double height_px,
                   StepWave& wave) const noexcept {
  const double inv_n = 1.0 / part.n;
  const double u = part.u * inv_n - surface.u0, v = part.v * inv_n - surface.v0;
  const double phase = radians_per_w_ * (surface.a * u + surface.b * v);
  const double per_u = radians_per_w_ * surface.a, per_v = radians_per_w_ * surface.b;
  const double damped = sinc(0.5 * per_u * width_px) * sinc(0.5 * per_v * height_px);
  const std::complex<double> one{damped * std::cos(phase), damped * std::sin(phase)};
  wave.one += part.n * one;
  // Inside the part to first order.
  const double uu = part.uu - part.u * part.u * inv_n, uv = part.uv - part.u * part.v * inv_n;
  const double vv = part.vv - part.v * part.v * inv_n;
  const std::complex<double> turned{-one.imag(), one.real()};
  wave.u += part.n * u * one + (uu * per_u + uv * per_v) * turned;
  wave.v += part.n * v * one + (uv * per_u + vv * per_v) * turned;
}

void StepBias::weaken(Eigen::Matrix3d& information, double noise_power, const PixelFrame& frame,
                      const Fit& surface, const Moments& m, const StepWave& wave,
                      double wave_pixels) const noexcept {
  const double uu = m.uu - m.u * surface.u0, uv = m.uv - m.u * surface.v0;
  const double vv = m.vv - m.v * surface.v0;
  const double det = uu * vv - uv * uv;
  if (!(radians_per_w_ > 0.0 && wave_pixels > 0.0 && det > 0.0)) return;
  const double scale = std::sqrt(power(surface.w0)) * m.n / wave_pixels;
  // Eq. 24: the wave's length is known roughly and it has harmonics: part of what the three
  // parameters take up of it goes to all of them alike.
  const auto taken = [&](double one, double u, double v) {
    return one * one / m.n + (vv * u * u - 2.0 * uv * u * v + uu * v * v) / det;
  };
  const double energy = scale * scale *
                        (taken(wave.one.real(), wave.u.real(), wave.v.real()) +
                         taken(wave.one.imag(), wave.u.imag(), wave.v.imag()));
  information *= noise_power / (noise_power + kAlikeShare * energy / 3.0);
  // Eq. 21: what least squares makes of the wave, at two phases a quarter apart.
  const auto lower = [&](double one, double u, double v) {
    const Fit bias{.u0 = surface.u0,
                   .v0 = surface.v0,
                   .w0 = scale * one / m.n,
                   .a = scale * (vv * u - uv * v) / det,
                   .b = scale * (uu * v - uv * u) / det};
    const Eigen::Vector3d theta = frame.theta(bias);
    const Eigen::Vector3d seen = information * theta;
    information -= seen * seen.transpose() / (1.0 + theta.dot(seen));  // eq. 22
  };
  lower(wave.one.real(), wave.u.real(), wave.v.real());
  lower(wave.one.imag(), wave.u.imag(), wave.v.imag());
}

}  // namespace maplet
