// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/sim/trajectory.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "drivers/sim/random.hpp"

namespace maplet::sim {
namespace {

constexpr int kSamplesPerKnot = 64;
constexpr int kWindow = 26;              // samples either side: 0.4 of a knot's span
constexpr double kLeastSlowness = 0.25;  // s per knot, where the path stands still

/// Uniform cubic B-spline weights and their derivatives.
struct Basis {
  explicit Basis(double t) noexcept
      : w{(1 - t) * (1 - t) * (1 - t) / 6, (3 * t * t * t - 6 * t * t + 4) / 6,
          (-3 * t * t * t + 3 * t * t + 3 * t + 1) / 6, t * t * t / 6},
        dw{-(1 - t) * (1 - t) / 2, (3 * t * t - 4 * t) / 2, (-3 * t * t + 2 * t + 1) / 2,
           t * t / 2},
        ddw{1 - t, 3 * t - 2, 1 - 3 * t, t} {}
  double w[4];
  double dw[4];
  double ddw[4];
};

/// Camera axes (x right, y down, z forward) of a camera that looks along yaw, pitched down, rolled.
Eigen::Quaterniond look(double yaw, double pitch_down, double roll) noexcept {
  const Eigen::Matrix3d level =
      (Eigen::Matrix3d() << 0, 0, 1, -1, 0, 0, 0, -1, 0).finished();  // looks along world x
  return Eigen::Quaterniond{Eigen::AngleAxisd{yaw, Eigen::Vector3d::UnitZ()}} *
         Eigen::Quaterniond{level} *
         Eigen::Quaterniond{Eigen::AngleAxisd{-pitch_down, Eigen::Vector3d::UnitX()}} *
         Eigen::Quaterniond{Eigen::AngleAxisd{roll, Eigen::Vector3d::UnitZ()}};
}

}  // namespace

Trajectory::Trajectory(const Route& route, const SimOptions& options) : route_{route} {
  auto& knots = route_.knots;
  turn_rad_ = 0.0;
  if (!route_.look_ahead) {
    // The knot after the last is the first again, whole turns later: those nearest to the last.
    const double turn = 2.0 * std::numbers::pi;
    turn_rad_ = turn * std::round((knots.back().yaw_rad - knots.front().yaw_rad) / turn);
  }
  if (options.reverse) {
    std::reverse(knots.begin(), knots.end());
    turn_rad_ = -turn_rad_;
  }
  make_waves(options);
  const double up_and_down = waves_[0].amplitude * waves_[0].rate_rad_per_s;
  const double sideways = waves_[1].amplitude * waves_[1].rate_rad_per_s;
  const double nodding = waves_[2].amplitude * waves_[2].rate_rad_per_s;
  // The last half percent is for what the waves do to each other.
  const double v = 0.995 * options.speed_m_per_s - sideways;
  make_times(std::sqrt(v * v - up_and_down * up_and_down),
             0.995 * options.yaw_rate_rad_per_s - nodding);
  Random random{static_cast<std::uint64_t>(options.seed),
                0x57a7 + static_cast<std::uint64_t>(options.agent)};
  const double phase = random.uniform(0.0, 1.0);
  start_s_ = round_s() * (options.phase >= 0.0 ? options.phase : phase);
}

void Trajectory::make_waves(const SimOptions& options) {
  Random random{static_cast<std::uint64_t>(options.seed),
                0x3abb1e + static_cast<std::uint64_t>(options.agent)};
  // A slow robot shakes less; this also keeps the waves well under the limits.
  const double scale = options.wobble * std::min(1.0, options.speed_m_per_s / 0.5) *
                       std::min(1.0, options.yaw_rate_rad_per_s / 0.5);
  constexpr double kAmplitude[] = {0.008, 0.003, 0.008, 0.018, 0.006, 0.010};  // m, m, rad...
  constexpr double kHz[] = {0.9, 0.45, 0.4, 0.23, 0.9, 0.31};
  for (std::size_t i = 0; i < waves_.size(); ++i) {
    waves_[i] = {scale * kAmplitude[i] * random.uniform(0.7, 1.0),
                 2.0 * std::numbers::pi * kHz[i] * random.uniform(0.8, 1.0),
                 random.uniform(0.0, 2.0 * std::numbers::pi)};
  }
}

double Trajectory::wobble(const Wave& wave, double time_s) const noexcept {
  return wave.amplitude * std::sin(wave.rate_rad_per_s * time_s + wave.phase_rad);
}

Trajectory::Place Trajectory::place(double s) const noexcept {
  const auto& knots = route_.knots;
  const int count = static_cast<int>(knots.size());
  const double base = std::floor(s);
  const Basis basis{s - base};
  Place out{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), 0.0, 0.0};
  Eigen::Vector3d bend = Eigen::Vector3d::Zero();
  for (int i = 0; i < 4; ++i) {
    const int at = static_cast<int>(base) + i - 1;
    const int round = at >= 0 ? at / count : (at - count + 1) / count;
    const Knot& knot = knots[static_cast<std::size_t>(at - round * count)];
    const Eigen::Vector3d p{knot.x_m, knot.y_m, knot.z_m};
    const double yaw = knot.yaw_rad + round * turn_rad_;
    out.p += basis.w[i] * p;
    out.velocity += basis.dw[i] * p;
    bend += basis.ddw[i] * p;
    out.yaw += basis.w[i] * yaw;
    out.yaw_rate += basis.dw[i] * yaw;
  }
  if (route_.look_ahead) {
    const Eigen::Vector3d& v = out.velocity;
    out.yaw = std::atan2(v.y(), v.x());
    out.yaw_rate = (v.x() * bend.y() - v.y() * bend.x()) / v.head<2>().squaredNorm();
  }
  return out;
}

void Trajectory::make_times(double speed, double yaw_rate) {
  const int count = static_cast<int>(route_.knots.size()) * kSamplesPerKnot;
  const auto n = static_cast<std::size_t>(count);
  std::vector<double> asked(n), widened(n);
  for (int i = 0; i < count; ++i) {
    const Place at = place(static_cast<double>(i) / kSamplesPerKnot);
    asked[static_cast<std::size_t>(i)] =
        std::max({kLeastSlowness, at.velocity.norm() / speed, std::abs(at.yaw_rate) / yaw_rate});
    length_m_ += at.velocity.norm() / kSamplesPerKnot;
  }
  const auto around = [count](int i) { return static_cast<std::size_t>((i + count) % count); };
  const int window = std::min(kWindow, count / 2 - 1);
  for (int i = 0; i < count; ++i) {
    double most = 0.0;
    // One more than the mean's window: the limits hold between the samples too.
    for (int k = -window - 1; k <= window + 1; ++k) most = std::max(most, asked[around(i + k)]);
    widened[static_cast<std::size_t>(i)] = most;
  }
  slowness_.resize(n + 1);
  for (int i = 0; i < count; ++i) {
    double sum = 0.0;
    double weights = 0.0;
    for (int k = -window; k <= window; ++k) {
      const double weight = 1.0 + std::cos(std::numbers::pi * k / (window + 1));
      sum += weight * widened[around(i + k)];
      weights += weight;
    }
    slowness_[static_cast<std::size_t>(i)] = sum / weights;
  }
  slowness_.back() = slowness_.front();
  times_.assign(n + 1, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    times_[i + 1] = times_[i] + 0.5 * (slowness_[i] + slowness_[i + 1]) / kSamplesPerKnot;
  }
}

double Trajectory::parameter_at(double time_s) const noexcept {
  const double round = round_s();
  const double t = time_s - std::floor(time_s / round) * round;
  const auto next = std::upper_bound(times_.begin() + 1, times_.end() - 1, t);
  const auto i = static_cast<std::size_t>(next - times_.begin()) - 1;
  // Slowness is linear inside a sample's cell, so time is a quadratic in the parameter.
  const double rest = (t - times_[i]) * kSamplesPerKnot;
  const double a = slowness_[i];
  const double slope = slowness_[i + 1] - slowness_[i];
  const double x = 2.0 * rest / (a + std::sqrt(std::max(0.0, a * a + 2.0 * slope * rest)));
  return (static_cast<double>(i) + x) / kSamplesPerKnot;
}

Se3 Trajectory::at(double time_s) const noexcept {
  const Place at = place(parameter_at(start_s_ + time_s));
  const double yaw = at.yaw + wobble(waves_[2], time_s);
  const double pitch = route_.pitch_rad + wobble(waves_[3], time_s) + wobble(waves_[4], time_s);
  Se3 T_world_camera;
  T_world_camera.q = look(yaw, pitch, wobble(waves_[5], time_s));
  T_world_camera.t = at.p + wobble(waves_[0], time_s) * Eigen::Vector3d::UnitZ() +
                     wobble(waves_[1], time_s) * Eigen::Vector3d{-std::sin(yaw), std::cos(yaw), 0};
  return T_world_camera;
}

}  // namespace maplet::sim
