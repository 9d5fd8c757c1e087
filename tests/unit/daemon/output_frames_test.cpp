// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/output_frames.hpp"

#include <gtest/gtest.h>

#include <memory>

#include "core/patches/patch.hpp"

namespace maplet::daemon {
namespace {

Se3 looks_ahead(const Eigen::Vector3d& at = Eigen::Vector3d::Zero()) {
  return {Eigen::Quaterniond{0.5, -0.5, 0.5, -0.5}, at};
}

OutsidePose inside_at(const Se3& T) {
  OutsidePose inside;
  inside.T_odom_base = T;
  return inside;
}

TEST(OutputFrames, TheBodyStandsAtTheOriginAndGoesAheadAlongX) {
  const OutputFrames frames{looks_ahead({0.1, 0.0, 0.3}), std::nullopt};
  const OutsidePose start = frames.outside(inside_at(Se3{}));
  EXPECT_LT(start.T_odom_base.t.norm(), 1e-12);
  EXPECT_LT(start.T_odom_base.angle(), 1e-12);
  // The camera goes ahead, then turns to the right: about its y, which points down.
  const Se3 ahead = Se3::exp(2.0 * Vector6d::Unit(2));
  EXPECT_LT((frames.outside(inside_at(ahead)).T_odom_base.t - Eigen::Vector3d{2, 0, 0}).norm(),
            1e-12);
  const Se3 right = Se3::exp(0.5 * Vector6d::Unit(4));
  const Se3 turned = frames.outside(inside_at(right)).T_odom_base;
  EXPECT_LT((turned.q * Eigen::Vector3d::UnitX()).y(), -0.4) << "left is y";
}

TEST(OutputFrames, ACameraThatLooksDownIsToldByUp) {
  // 0.4 rad down, and body.T_body_camera does not say so: up leans back in the camera's frame.
  const Vector3OrAuto up = std::array{0.0, -std::cos(0.4), -std::sin(0.4)};
  OutputFrames frames{looks_ahead(), up};
  frames.begin(*std::make_unique<PatchSet>());
  const Se3 ahead = Se3::exp(1.0 * Vector6d::Unit(2));
  const Eigen::Vector3d t = frames.outside(inside_at(ahead)).T_odom_base.t;
  EXPECT_NEAR(t.z(), -std::sin(0.4), 1e-9) << "along its view it goes down";
  EXPECT_NEAR(t.x(), std::cos(0.4), 1e-9);
  EXPECT_NEAR(t.y(), 0.0, 1e-9);
}

TEST(OutputFrames, CovarianceAndTwistAreTheBodys) {
  const Se3 T_body_camera = looks_ahead({1.0, 0.0, 0.0});
  const OutputFrames frames{T_body_camera, std::nullopt};
  OutsidePose inside;
  inside.covariance(2, 2) = 4.0;  // ahead
  inside.covariance(4, 4) = 1.0;  // about the camera's y: the body's -z
  inside.twist = 0.5 * Vector6d::Unit(4);
  const OutsidePose out = frames.outside(inside);
  EXPECT_NEAR(out.covariance(0, 0), 4.0, 1e-12);
  EXPECT_NEAR(out.covariance(5, 5), 1.0, 1e-12);
  EXPECT_NEAR(out.covariance(1, 1), 1.0, 1e-12) << "the lever from the camera to the body";
  EXPECT_NEAR(out.twist[5], -0.5, 1e-12);
  // The camera stays where it is while it turns: the body goes round it.
  EXPECT_NEAR(out.twist[1], 0.5, 1e-12);
}

TEST(OutputFrames, NedFrdIsTheSameSeenFromBelow) {
  const OutputFrames frames{looks_ahead(), std::nullopt};
  Vector6d xi;
  xi << 0.3, -0.2, 1.0, 0.1, 0.4, -0.2;
  OutsidePose inside = inside_at(Se3::exp(xi));
  inside.twist = xi;
  inside.covariance = xi * xi.transpose();
  const OutsidePose flu = frames.outside(inside);
  const OutsidePose frd = to_ned_frd(flu);
  EXPECT_NEAR(frd.T_odom_base.t.x(), flu.T_odom_base.t.x(), 1e-12);
  EXPECT_NEAR(frd.T_odom_base.t.y(), -flu.T_odom_base.t.y(), 1e-12);
  EXPECT_NEAR(frd.T_odom_base.t.z(), -flu.T_odom_base.t.z(), 1e-12);
  EXPECT_NEAR(frd.twist[5], -flu.twist[5], 1e-12);
  const OutsidePose back = to_ned_frd(frd);
  EXPECT_LT((back.covariance - flu.covariance).norm(), 1e-12);
  EXPECT_LT((back.T_odom_base.inverse() * flu.T_odom_base).log().norm(), 1e-9);
}

// The map of another group hangs from a camera that stood elsewhere: still level.
TEST(OutputFrames, AnothersMapIsLevelToo) {
  OutputFrames frames{looks_ahead(), std::nullopt};
  Vector6d tilted;
  tilted << 3.0, 0.5, -2.0, 0.3, 1.2, -0.2;
  MapFrame::Notice map;
  map.map = {2, 7, 0};
  map.T_map_odom = Se3::exp(tilted);
  frames.follow(map);
  OutsidePose inside = inside_at(Se3::exp(0.7 * Vector6d::Unit(4)));
  inside.T_map_odom = map.T_map_odom;
  const OutsidePose out = frames.outside(inside);
  const Eigen::Vector3d up = out.T_map_odom.q * Eigen::Vector3d::UnitZ();
  EXPECT_NEAR(up.z(), 1.0, 1e-9);
  // Where the skeleton puts the camera, tf puts it too.
  const Se3 by_tf = out.T_map_odom * out.T_odom_base * frames.T_body_camera();
  const Se3 by_map = frames.map_pose(map.T_map_odom * inside.T_odom_base);
  EXPECT_LT((by_tf.inverse() * by_map).log().norm(), 1e-9);
}

}  // namespace
}  // namespace maplet::daemon
