// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Without noise a pixel's depth is where its ray meets the labelled plane, and nothing is nearer.
#include <Eigen/Geometry>
#include <cmath>

#include "tests/unit/sim/sim_test.hpp"

namespace maplet {
namespace {

using test::sim;

class Worlds : public testing::TestWithParam<const char*> {
 protected:
  std::unique_ptr<SimSource> source_ =
      sim(GetParam(), {{"width", "320"}, {"noise", "0"}, {"gray", "0"}, {"seed", "7"}});
};
INSTANTIATE_TEST_SUITE_P(Sim, Worlds,
                         testing::Values("room", "loop", "corridor", "symmetric", "wall", "edge"));

TEST_P(Worlds, DepthLiesOnTheLabelledPlane) {
  const std::uint64_t step = *source_->length() / 6;
  for (std::uint64_t index = 0; index < *source_->length(); index += step) {
    source_->seek(index);
    const auto frame = source_->next(Deadline::never());
    ASSERT_TRUE(frame);
    const Se3 T_camera_world = source_->T_world_camera().se3.inverse();
    std::vector<Plane> planes;
    for (const Plane& plane : source_->planes()) planes.push_back(T_camera_world * plane);
    int valid = 0;
    for (int v = 0; v < frame->depth.height_px; ++v) {
      for (int u = 0; u < frame->depth.width_px; ++u) {
        const std::uint16_t mm = frame->depth.at(u, v);
        const std::uint16_t id =
            source_->labels()[static_cast<std::size_t>(v * frame->depth.width_px + u)];
        ASSERT_EQ(mm == 0, id == 0) << u << " " << v;
        if (id == 0) continue;
        ++valid;
        const Plane& plane = planes[id - std::size_t{1}];
        ASSERT_GT(plane.d, 0.0);  // n is on the camera's side
        const double z = -plane.d / plane.n.dot(frame->camera.ray(u, v));
        ASSERT_NEAR(mm * 1e-3, z, 0.51e-3) << "pixel " << u << " " << v << " plane " << id;
      }
    }
    EXPECT_GT(valid, frame->depth.width_px * frame->depth.height_px / 4) << "frame " << index;
  }
}

/// Inverse depth along a ray of the world's nearest surface, the slow way.
double cast(const sim::World& world, const Eigen::Vector3d& from, const Eigen::Vector3d& ray) {
  double nearest = 0.0;
  for (const sim::Surface& s : world.surfaces) {
    const Eigen::Vector3d n = s.along.cross(s.across);
    const double slope = n.dot(ray);
    if (slope >= 0.0) continue;  // from behind
    const double z = n.dot(s.corner - from) / slope;
    if (z <= 0.0) continue;
    const Eigen::Vector3d p = from + z * ray - s.corner;
    const double a = p.dot(s.along) / s.along.squaredNorm();
    const double b = p.dot(s.across) / s.across.squaredNorm();
    if (a >= 0.0 && a <= 1.0 && b >= 0.0 && b <= 1.0) nearest = std::max(nearest, 1.0 / z);
  }
  return nearest;
}

TEST_P(Worlds, NothingIsNearer) {
  const std::uint64_t step = *source_->length() / 5;
  int seen = 0;
  for (std::uint64_t index = 3; index < *source_->length(); index += step) {
    source_->seek(index);
    const auto frame = source_->next(Deadline::never());
    ASSERT_TRUE(frame);
    const Se3& pose = source_->T_world_camera().se3;
    for (int v = 0; v < frame->depth.height_px; v += 7) {
      for (int u = 0; u < frame->depth.width_px; u += 5) {
        const double w = cast(source_->world(), pose.t, pose.q * frame->camera.ray(u, v));
        const int i = v * frame->depth.width_px + u;
        ASSERT_NEAR(static_cast<double>(source_->exact_inverse_depth()[i]), w, 2e-6 + 2e-6 * w)
            << "frame " << index << " pixel " << u << " " << v;
        seen += w > 0.0 ? 1 : 0;
      }
    }
  }
  EXPECT_GT(seen, 10000);
}

TEST_P(Worlds, NoSeamsBetweenSurfaces) {
  const std::string world = GetParam();
  for (std::uint64_t index = 0; index < *source_->length(); index += *source_->length() / 20) {
    source_->seek(index);
    ASSERT_TRUE(source_->next(Deadline::never()));
    for (std::size_t i = 0; i < source_->labels().size(); ++i) {
      // The corridor's ends are beyond the range, not open.
      ASSERT_GT(source_->exact_inverse_depth()[i], 0.0F) << "frame " << index << " pixel " << i;
    }
  }
}

}  // namespace
}  // namespace maplet
