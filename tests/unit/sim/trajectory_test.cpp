// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/sim/trajectory.hpp"

#include <cmath>

#include "tests/unit/sim/sim_test.hpp"

namespace maplet {
namespace {

using test::Parameters;
using test::sim;

struct Case {
  const char* world;
  Parameters parameters;
};
void PrintTo(const Case& one, std::ostream* out) {
  *out << one.world;
  for (const auto& [key, value] : one.parameters) *out << ' ' << key << '=' << value;
}

class Trajectories : public testing::TestWithParam<Case> {
 protected:
  Trajectories() {
    Parameters parameters = GetParam().parameters;
    parameters.insert({{"gray", "0"}, {"width", "160"}});
    source_ = sim(GetParam().world, parameters);
  }
  std::unique_ptr<SimSource> source_;
};
INSTANTIATE_TEST_SUITE_P(
    Sim, Trajectories,
    testing::Values(Case{"room", {}}, Case{"room", {{"reverse", "1"}, {"seed", "9"}}},
                    Case{"loop", {}}, Case{"loop", {{"loop_m", "110"}, {"speed_m_per_s", "1.2"}}},
                    Case{"loop", {{"reverse", "1"}, {"yaw_rate_rad_per_s", "0.3"}}},
                    Case{"corridor", {{"wobble", "3"}}}, Case{"symmetric", {}}, Case{"wall", {}},
                    Case{"edge", {{"speed_m_per_s", "0.05"}}}),
    [](const auto& one) { return one.param.world + std::to_string(one.index); });

double yaw_of(const Se3& pose) {
  const Eigen::Vector3d forward = pose.q * Eigen::Vector3d::UnitZ();
  return std::atan2(forward.y(), forward.x());
}

TEST_P(Trajectories, KeepSpeedAndYawRateUnderTheLimits) {
  const auto& trajectory = source_->trajectory();
  const auto& options = source_->options();
  constexpr double kStep = 0.01;
  double fastest = 0.0;
  for (double t = 0.0; t < trajectory.round_s() * 1.1; t += kStep) {
    const Se3 a = trajectory.at(t);
    const Se3 b = trajectory.at(t + kStep);
    const double speed = (b.t - a.t).norm() / kStep;
    const double yaw_rate = std::abs(std::remainder(yaw_of(b) - yaw_of(a), 2 * M_PI)) / kStep;
    ASSERT_LE(speed, options.speed_m_per_s) << "at " << t << " s";
    ASSERT_LE(yaw_rate, options.yaw_rate_rad_per_s) << "at " << t << " s";
    fastest =
        std::max({fastest, speed / options.speed_m_per_s, yaw_rate / options.yaw_rate_rad_per_s});
  }
  EXPECT_GT(fastest, 0.7);  // the limits are used, not just kept
}

TEST_P(Trajectories, AreSmooth) {
  const auto& trajectory = source_->trajectory();
  constexpr double kStep = 0.005;
  for (double t = 0.0; t < trajectory.round_s() * 1.1; t += kStep) {
    const Se3 a = trajectory.at(t);
    const Se3 b = trajectory.at(t + kStep);
    const Se3 c = trajectory.at(t + 2 * kStep);
    const Eigen::Vector3d acceleration = (c.t - 2 * b.t + a.t) / (kStep * kStep);
    ASSERT_LT(acceleration.norm(), 3.0) << "m/s^2 at " << t << " s";
    const Vector6d first = (a.inverse() * b).log();
    const Vector6d second = (b.inverse() * c).log();
    ASSERT_LT((second - first).tail<3>().norm() / (kStep * kStep), 4.0) << "rad/s^2 at " << t;
  }
}

TEST_P(Trajectories, KeepTheCameraRoughlyLevel) {
  const auto& trajectory = source_->trajectory();
  for (double t = 0.0; t < trajectory.round_s(); t += 0.05) {
    const Eigen::Vector3d right = trajectory.at(t).q * Eigen::Vector3d::UnitX();
    const Eigen::Vector3d down = trajectory.at(t).q * Eigen::Vector3d::UnitY();
    ASSERT_LT(std::abs(right.z()), 0.06);
    ASSERT_LT(down.z(), -0.9);
  }
}

TEST_P(Trajectories, ReturnToTheirStart) {
  const auto& trajectory = source_->trajectory();
  const Se3 gap = trajectory.at(0.0).inverse() * trajectory.at(trajectory.round_s());
  const double wobble = source_->options().wobble;
  EXPECT_LT(gap.t.norm(), 0.03 * wobble);  // the wobble goes on
  EXPECT_LT(gap.angle(), 0.07 * wobble);
  // By default the recording is a round, to the frame.
  const double last = seconds(Stamp{static_cast<std::int64_t>(
      static_cast<double>(*source_->length() - 1) * 1e9 / source_->options().rate_hz)});
  EXPECT_GE(last, trajectory.round_s() - 1e-6);
  EXPECT_LE(last, trajectory.round_s() + 1.0 / source_->options().rate_hz);
}

TEST_P(Trajectories, StayClearOfEverything) {
  for (std::uint64_t index = 0; index < *source_->length(); index += 15) {
    source_->seek(index);
    ASSERT_TRUE(source_->next(Deadline::never()));
    const auto count = static_cast<std::ptrdiff_t>(source_->labels().size());
    const float* inverse = source_->exact_inverse_depth();
    ASSERT_LT(*std::max_element(inverse, inverse + count), 1.0F / 0.25F) << "frame " << index;
  }
}

TEST(Trajectory, LoopIsAsLongAsAskedFor) {
  for (const double asked_m : {44.0, 60.0, 110.0}) {
    const auto source = sim("loop", {{"loop_m", std::to_string(asked_m)}, {"gray", "0"}});
    EXPECT_GT(source->trajectory().round_m(), asked_m - 4.0);
    EXPECT_LT(source->trajectory().round_m(), asked_m + 1.0);
  }
  EXPECT_GE(sim("loop", {{"gray", "0"}})->trajectory().round_m(), 40.0);
}

TEST(Trajectory, AgentsStartElsewhereInTheSameWorld) {
  const auto a = sim("loop", {{"agent", "0"}, {"width", "160"}});
  const auto b = sim("loop", {{"agent", "1"}, {"width", "160"}});
  EXPECT_EQ(a->planes().size(), b->planes().size());
  for (std::size_t i = 0; i < a->planes().size(); ++i) {
    EXPECT_EQ(a->planes()[i].d, b->planes()[i].d);
  }
  EXPECT_GT((a->pose(0).se3.t - b->pose(0).se3.t).norm(), 0.5);
}

TEST(Trajectory, PhaseChoosesTheStart) {
  const auto a = sim("loop", {{"phase", "0.25"}, {"width", "160"}, {"wobble", "0"}});
  const auto b = sim("loop", {{"phase", "0"}, {"width", "160"}, {"wobble", "0"}});
  const Se3 there = b->trajectory().at(0.25 * b->trajectory().round_s());
  EXPECT_LT((a->pose(0).se3.t - there.t).norm(), 1e-9);
}

}  // namespace
}  // namespace maplet
