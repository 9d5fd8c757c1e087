// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/camera_toml.hpp"

#include <gtest/gtest.h>

namespace maplet {
namespace {

constexpr const char* kGood = R"([depth]
width_px = 640
height_px = 480
fx_px = 535.4
fy_px = 539.2
cx_px = 320.1
cy_px = 247.6
metres_per_unit = 0.0002
invalid_values = [0, 65535]
registered_to_colour = true
rate_hz = 30.0

[colour]
model = "anything"
)";

std::string with(std::string_view from, std::string_view to) {
  std::string text = kGood;
  return text.replace(text.find(from), from.size(), to);
}

TEST(CameraToml, SaysAllThereIs) {
  const auto got = parse_camera_toml(kGood, "camera.toml");
  ASSERT_TRUE(got) << got.error();
  EXPECT_EQ(got->camera.width_px, 640);
  EXPECT_EQ(got->camera.height_px, 480);
  EXPECT_EQ(got->camera.fx_px, 535.4);
  EXPECT_EQ(got->camera.fy_px, 539.2);
  EXPECT_EQ(got->camera.cx_px, 320.1);
  EXPECT_EQ(got->camera.cy_px, 247.6);
  EXPECT_EQ(got->metres_per_unit, 0.0002);
  EXPECT_EQ(got->invalid_values, (InvalidValues{65535}));
  EXPECT_TRUE(got->registered_to_colour);
  EXPECT_EQ(got->rate_hz, 30.0);
}

TEST(CameraToml, DoesWithoutTheOptionalKeys) {
  std::string text = kGood;
  text.resize(text.find("invalid_values"));
  const auto got = parse_camera_toml(text, "camera.toml");
  ASSERT_TRUE(got) << got.error();
  EXPECT_TRUE(got->invalid_values.empty());
  EXPECT_FALSE(got->registered_to_colour);
}

TEST(CameraToml, TakesFlippedImages) {  // ICL-NUIM: fy is negative
  EXPECT_TRUE(parse_camera_toml(with("fy_px = 539.2", "fy_px = -480.0"), "camera.toml"));
}

struct Wrong {
  const char* from;
  const char* to;
  const char* said;
};

class WrongCameraToml : public testing::TestWithParam<Wrong> {};

TEST_P(WrongCameraToml, IsRefusedInOneLineThatNamesIt) {
  const auto got = parse_camera_toml(with(GetParam().from, GetParam().to), "x/camera.toml");
  ASSERT_FALSE(got);
  EXPECT_NE(got.error().find("x/camera.toml"), std::string::npos) << got.error();
  EXPECT_NE(got.error().find(GetParam().said), std::string::npos) << got.error();
  EXPECT_EQ(got.error().find('\n'), std::string::npos);
}

INSTANTIATE_TEST_SUITE_P(
    Each, WrongCameraToml,
    testing::Values(Wrong{"[depth]", "[deepth]", "no table [depth]"},
                    Wrong{"fx_px = 535.4\n", "", "depth.fx_px is missing"},
                    Wrong{"metres_per_unit = 0.0002\n", "", "depth.metres_per_unit is missing"},
                    Wrong{"fx_px = 535.4", "fx_px = 0.0", "not 0"},
                    Wrong{"fx_px = 535.4", "fx_px = -1.0", "field of view"},
                    Wrong{"fx_px = 535.4", "fx_px = nan", ":4: fx_px: expected a number"},
                    Wrong{"fx_px = 535.4", "fx_px = \"535\"", ":4: fx_px: expected a number"},
                    Wrong{"width_px = 640", "width_px = 100000", ":2: width_px"},
                    Wrong{"width_px = 640", "width_px = -1", ":2: width_px"},
                    Wrong{"width_px = 640", "width_px = 640.5", "whole"},
                    Wrong{"metres_per_unit = 0.0002", "metres_per_unit = 0", "metres_per_unit"},
                    Wrong{"[0, 65535]", "[0, 65536]", ":9: invalid_values"},
                    Wrong{"[0, 65535]", "65535", ":9: invalid_values"},
                    Wrong{"[0, 65535]", "[1,2,3,4,5,6,7,8,9]", "at most 8"},
                    Wrong{"colour = true", "color = true", ":10: unknown key"},
                    Wrong{"colour = true", "colour = true\n\"a\\nb\" = 1", ":11: unknown key"},
                    Wrong{"colour = true", "colour = 1", ":10: registered_to_colour"},
                    Wrong{"rate_hz = 30.0", "rate_hz = ", ":11"}));

}  // namespace
}  // namespace maplet
