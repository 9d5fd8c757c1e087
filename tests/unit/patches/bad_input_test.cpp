// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <limits>
#include <numbers>

#include "core/patches/extractor.hpp"
#include "tests/unit/patches/synthetic.hpp"

namespace maplet {
namespace {

using test::Image;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();
const Eigen::Vector3d kWall{0.05, -0.1, 0.5};  // 2 m ahead

/// Whatever comes in: a result that is empty or makes sense.
class BadInput : public testing::Test {
 protected:
  const PatchSet& run(const DepthFrame& frame) {
    const PatchSet& set = extractor_.run(frame, Deadline::never());
    for (const Patch& p : set.patches) {
      EXPECT_TRUE(p.theta.allFinite() && p.information.allFinite());
      EXPECT_LE(p.u_px + p.width_px, frame.depth.width_px);
      EXPECT_LE(p.v_px + p.height_px, frame.depth.height_px);
    }
    for (const FramePlane& p : set.planes) {
      EXPECT_TRUE(p.theta.allFinite() && p.information.allFinite());
      EXPECT_GE(p.area_m2, 0.0F);
    }
    return set;
  }
  const PatchSet& run_constant(int raw) {
    image_.depth.assign(image_.depth.size(), static_cast<std::uint16_t>(raw));
    return run(image_.frame());
  }

  std::mt19937 rng_{1};
  Arena arena_;
  PatchExtractor extractor_{PatchConfig{}, arena_};
  Image image_{320, 240};
};

TEST_F(BadInput, ZeroAndSaturatedDepthIsNoDepth) {
  for (const int raw : {0, 65535}) {
    const PatchSet& set = run_constant(raw);
    EXPECT_EQ(set.valid_pixels, 0u) << raw;
    EXPECT_TRUE(set.patches.empty() && set.planes.empty()) << raw;
    EXPECT_EQ(set.stop, Stop::kConverged);
  }
}

TEST_F(BadInput, NearerThanAnyLensIsNoDepth) {
  EXPECT_EQ(run_constant(1).valid_pixels, 0u);
  EXPECT_EQ(run_constant(62).valid_pixels, 0u);
}

TEST_F(BadInput, ConstantFrameIsOneFrontalPlane) {
  for (const int raw : {63, 500, 3000, 65534}) {
    const PatchSet& set = run_constant(raw);
    ASSERT_EQ(set.planes.size(), 1u) << raw;
    EXPECT_NEAR(set.planes[0].theta.z() * raw * 1e-3, 1.0, 1e-3) << raw;
    EXPECT_NEAR(set.planes[0].theta.head<2>().norm(), 0.0, 1e-6) << raw;
    EXPECT_EQ(set.planes[0].pixels, 320u * 240u) << raw;
  }
}

TEST_F(BadInput, TenKilometresIsAPlaneToo) {
  image_.metres_per_unit = 1.0;
  const PatchSet& set = run_constant(10000);
  ASSERT_EQ(set.planes.size(), 1u);
  EXPECT_NEAR(set.planes[0].plane().d, 1e4, 1.5e3);  // three steps of inverse depth
  EXPECT_EQ(run_constant(65534).planes.size() <= 1, true);
}

TEST_F(BadInput, OnePixelIsNoPlane) {
  for (const std::size_t where :
       {std::size_t{0}, std::size_t{319}, image_.depth.size() - 1, std::size_t{120 * 320 + 160}}) {
    run_constant(0);
    image_.depth[where] = 2000;
    const PatchSet& set = run(image_.frame());
    EXPECT_EQ(set.valid_pixels, 1u);
    EXPECT_TRUE(set.patches.empty() && set.planes.empty());
  }
}

TEST_F(BadInput, RandomFramesAreDefined) {
  for (int k = 0; k < 4; ++k) {
    for (auto& p : image_.depth) p = static_cast<std::uint16_t>(rng_());
    const PatchSet& set = run(image_.frame());
    EXPECT_LT(set.covered_pixels, set.valid_pixels / 50);
    EXPECT_LT(set.planes.size(), 3u);
  }
}

TEST_F(BadInput, AnySizeHasAResult) {
  for (const auto& [w, h] : {std::pair{1, 1},
                             {1, 480},
                             {640, 1},
                             {7, 9},
                             {8, 8},
                             {9, 7},
                             {17, 33},
                             {63, 65},
                             {161, 121},
                             {641, 479},
                             {1279, 1023},
                             {1280, 1024}}) {
    Image image{w, h};
    image.camera.fx_px = image.camera.fy_px = 500.0;
    image.draw(kWall, 1.0, rng_);
    const PatchSet& set = run(image.frame());
    EXPECT_EQ(set.valid_pixels, static_cast<std::uint32_t>(w * h)) << w << "x" << h;
    std::vector<std::uint16_t> labels(image.depth.size());
    extractor_.write_labels(image.frame(), labels);
    if (std::min(w, h) < 17) continue;
    ASSERT_EQ(set.planes.size(), 1u) << w << "x" << h;
    EXPECT_GT(std::count(labels.begin(), labels.end(), 1), 0.97 * w * h) << w << "x" << h;
  }
}

TEST_F(BadInput, BeyondTheLargestSizeIsEmpty) {
  Image image{1288, 8};
  image.draw(kWall, 1.0, rng_);
  EXPECT_TRUE(run(image.frame()).patches.empty());
}

TEST_F(BadInput, StrideSkipsWhatIsBetweenRows) {
  image_.draw(kWall, 1.0, rng_);
  const PatchSet tight = run(image_.frame());
  constexpr int kStride = 331;
  std::vector<std::uint16_t> padded(static_cast<std::size_t>(240 * kStride), 777);
  for (int v = 0; v < 240; ++v) {
    std::copy_n(image_.depth.begin() + v * 320, 320, padded.begin() + v * kStride);
  }
  DepthFrame frame = image_.frame();
  frame.depth = {padded.data(), 320, 240, kStride};
  const PatchSet& set = run(frame);
  ASSERT_EQ(set.planes.size(), tight.planes.size());
  EXPECT_EQ(set.planes[0].theta, tight.planes[0].theta);
  EXPECT_EQ(set.planes[0].pixels, tight.planes[0].pixels);
}

TEST_F(BadInput, NegativeFocalLengthIsAMirroredImage) {
  image_.camera.fy_px = -image_.camera.fy_px;
  image_.draw(kWall, 1.0, rng_);
  const PatchSet& set = run(image_.frame());
  ASSERT_EQ(set.planes.size(), 1u);
  EXPECT_LT((set.planes[0].theta - kWall).norm(), 5e-4);
  EXPECT_GT(set.planes[0].area_m2, 0.0F);
}

TEST_F(BadInput, ImpossibleCamerasHaveAnEmptyResult) {
  image_.draw(kWall, 1.0, rng_);
  for (const double f : {0.0, kNan, kInf, -kInf, 1e-300, 1e300}) {
    for (double CameraModel::*const member : {&CameraModel::fx_px, &CameraModel::fy_px}) {
      DepthFrame frame = image_.frame();
      frame.camera.*member = f;
      EXPECT_TRUE(run(frame).patches.empty()) << f;
    }
  }
  DepthFrame frame = image_.frame();
  frame.camera.cx_px = kNan;
  EXPECT_TRUE(run(frame).patches.empty());
  frame = image_.frame();
  frame.camera.width_px = 640;  // of another image
  EXPECT_TRUE(run(frame).patches.empty());
}

TEST_F(BadInput, ImpossibleUnitsHaveAnEmptyResult) {
  image_.draw(kWall, 1.0, rng_);
  for (const double unit : {0.0, -0.001, kNan, kInf, 1e-300}) {
    DepthFrame frame = image_.frame();
    frame.metres_per_unit = unit;
    EXPECT_TRUE(run(frame).patches.empty()) << unit;
  }
}

TEST_F(BadInput, ImpossibleNoiseFiguresStillGiveFinitePlanes) {
  image_.draw(kWall, 1.0, rng_);
  for (const double value : {0.0, -1.0, kNan, kInf, 1e-300, 1e300}) {
    for (const auto kind : {NoiseModel::Kind::kDisparity, NoiseModel::Kind::kTimeOfFlight}) {
      DepthFrame frame = image_.frame();
      frame.noise.kind = kind;
      frame.noise.disparity_k = frame.noise.correlated_px = value;
      frame.noise.tof_floor_m = frame.noise.tof_slope = value;
      frame.noise.lateral_px = frame.noise.disparity_step = value;
      (void)run(frame);
    }
    DepthFrame frame = image_.frame();
    frame.noise.lateral_px = frame.noise.disparity_step = value;
    EXPECT_EQ(run(frame).planes.size(), 1u) << value;
  }
}

TEST_F(BadInput, GrayOfAnotherSizeIsLeftAlone) {
  image_.draw(kWall, 1.0, rng_);
  const std::vector<std::uint8_t> gray(64, 200);
  DepthFrame frame = image_.frame();
  frame.gray = {gray.data(), 8, 8, 8};
  EXPECT_LT(run(frame).planes.at(0).mean_gray, 0.0F);
}

TEST_F(BadInput, AForgottenFrameLeavesNothingBehind) {
  image_.draw(kWall, 1.0, rng_);
  ASSERT_FALSE(run(image_.frame()).planes.empty());
  DepthFrame none = image_.frame();
  none.camera.fx_px = 0.0;
  EXPECT_TRUE(run(none).planes.empty());
  std::vector<std::uint16_t> labels(image_.depth.size(), 9);
  extractor_.write_labels(none, labels);
  EXPECT_EQ(std::count(labels.begin(), labels.end(), 0), static_cast<long>(labels.size()));
}

}  // namespace
}  // namespace maplet
