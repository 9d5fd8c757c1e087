// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The real libcamera: with no camera at all, and with vimc's where the kernel has it.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include "drivers/gray_camera.hpp"

namespace maplet {
namespace {

using namespace std::chrono_literals;

constexpr int kWidth = 156;  // vimc makes multiples of six
constexpr int kHeight = 120;

GrayCameraOptions options(const std::string& id) {
  GrayCameraOptions options;
  options.id = id;
  options.camera = {kWidth, kHeight, 150.0, 150.0, 77.5, 59.5};
  return options;
}

std::string said(const GrayCamera& camera) {
  const Line state = camera.state();
  return std::string{view(state)};
}

template <class Condition>
bool soon(Condition condition) {
  for (int i = 0; i < 400 && !condition(); ++i) std::this_thread::sleep_for(25ms);
  return condition();
}

TEST(Libcamera, GoesOnWithoutACamera) {
  const auto camera = open_libcamera(options("no such camera"));
  ASSERT_TRUE(camera) << camera.error();
  ASSERT_TRUE(soon([&] { return !said(**camera).empty(); }));
  EXPECT_NE(said(**camera).find("depth goes on alone"), std::string::npos) << said(**camera);
  EXPECT_FALSE((*camera)->running());
  EXPECT_EQ((*camera)->images(), 0u);
  std::vector<std::uint8_t> image(kWidth * kHeight);
  const MonotonicClock clock;
  const Instant began = clock.now();
  EXPECT_FALSE((*camera)->nearest(began, 20ms, 500ms, image));
  EXPECT_LT(clock.now() - began, 100ms) << "nobody waits for a camera that is not there";
}

/// The first of vimc's cameras; empty where there is none.
std::string vimc() {
  const auto cameras = libcamera_cameras();
  if (!cameras) return {};
  for (const std::string& camera : *cameras) {
    if (camera.find("vimc") != std::string::npos) return camera.substr(0, camera.find(" ("));
  }
  return {};
}

TEST(Libcamera, BringsImagesOfVimc) {
  const std::string id = vimc();
  if (id.empty()) GTEST_SKIP() << "this kernel has no vimc, or libcamera-ipa is missing";
  const auto camera = open_libcamera(options(id));
  ASSERT_TRUE(camera) << camera.error();
  ASSERT_TRUE(soon([&] { return (*camera)->images() >= 10; })) << said(**camera);
  EXPECT_TRUE((*camera)->running());
  std::vector<std::uint8_t> image(kWidth * kHeight);
  const MonotonicClock clock;
  ASSERT_TRUE((*camera)->nearest(clock.now(), 200ms, 200ms, image));
  const auto [least, most] = std::minmax_element(image.begin(), image.end());
  EXPECT_GT(*most - *least, 50) << "vimc shows colour bars";
  const auto busy = open_libcamera(options(id));
  ASSERT_TRUE(soon([&] { return !said(**busy).empty(); }));
  EXPECT_NE(said(**busy).find("depth goes on alone"), std::string::npos) << said(**busy);
}

}  // namespace
}  // namespace maplet
