// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/config_io.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace maplet::daemon {
namespace {

using std::chrono::microseconds;
using testing::AllOf;
using testing::HasSubstr;

std::string error_of(std::string_view text) {
  const auto parsed = parse_config(text, "test.toml");
  return parsed ? "" : parsed.error();
}

TEST(ConfigIo, ReadsWhatIsSaidAndKeepsTheRest) {
  const auto config = parse_config("[input]\ndecimate = 2\n[frame]\nbudget_us = 5000\n", "t");
  ASSERT_TRUE(config) << config.error();
  EXPECT_EQ(config->agent.decimator.step, 2);
  EXPECT_EQ(config->agent.frame.budget, microseconds{5000});
  EXPECT_EQ(config->input.gray, "auto");
}

TEST(ConfigIo, SomeKeysStandBeforeAllSections) {
  const auto config = parse_config("motion = \"planar\"\n[body]\nup = [0, -1, 0]\n", "t");
  ASSERT_TRUE(config) << config.error();
  EXPECT_EQ(config->mission.motion, "planar");
  EXPECT_THAT(error_of("motion = \"2d\"\n"),
              AllOf(HasSubstr("test.toml:1"), HasSubstr("3d|planar")));
  EXPECT_THAT(error_of("[motion]\nx = 1\n"), HasSubstr("3d|planar"));
  EXPECT_THAT(error_of("[input]\nmotion = \"planar\"\n"), HasSubstr("unknown key"));
  Config changed;
  ASSERT_TRUE(set_key(changed, "motion=planar"));
  EXPECT_EQ(changed.mission.motion, "planar");
}

TEST(ConfigIo, UnknownKeyNamesFileAndLine) {
  EXPECT_THAT(error_of("[input]\n\ndecimte = 2\n"), HasSubstr("test.toml:3"));
  EXPECT_THAT(error_of("[input]\n\ndecimte = 2\n"), HasSubstr("input.decimte"));
  EXPECT_THAT(error_of("[input]\n\ndecimte = 2\n"), HasSubstr("perhaps input.decimate"));
  EXPECT_THAT(error_of("[inputs]\n"), HasSubstr("test.toml:1"));
  EXPECT_THAT(error_of("source = \"x\"\n"), HasSubstr("unknown key 'source'"));
}

TEST(ConfigIo, ValueOutOfRangeNamesTheRange) {
  const std::string error = error_of("[dds]\ndomain = 500\n");
  EXPECT_THAT(error, HasSubstr("test.toml:2"));
  EXPECT_THAT(error, HasSubstr("dds.domain = 500"));
  EXPECT_THAT(error, HasSubstr("0 .. 230"));
  EXPECT_THAT(error_of("[input]\n\ndecimate = 3\n"),
              AllOf(HasSubstr("test.toml:3"), HasSubstr("must be 1|2|4")));
}

TEST(ConfigIo, WrongTypesAndNotANumberAreRefused) {
  EXPECT_THAT(error_of("[dds]\ndomain = \"three\"\n"), HasSubstr("dds.domain"));
  EXPECT_THAT(error_of("[dds]\ndomain = 1.5\n"), HasSubstr("dds.domain"));
  EXPECT_THAT(error_of("[camera]\ncx_px = nan\n"), HasSubstr("camera.cx_px"));
  EXPECT_THAT(error_of("[input]\ngray = \"maybe\"\n"), HasSubstr("auto|off"));
  EXPECT_THAT(error_of("[input\n"), HasSubstr("not TOML"));
}

TEST(ConfigIo, WhatGoesTogetherIsCheckedTogether) {
  Config config;
  ASSERT_TRUE(set_key(config, "camera.fx_px=500"));
  EXPECT_THAT(check_together(config).error(), HasSubstr("go together"));
  for (const char* more : {"camera.fy_px=500", "camera.width_px=640", "camera.height_px=480"}) {
    ASSERT_TRUE(set_key(config, more));
  }
  EXPECT_TRUE(check_together(config));
  for (const char* pair : {"patches.cell_px=64", "patches.max_node_px=32"}) {
    ASSERT_TRUE(set_key(config, pair));
  }
  EXPECT_THAT(check_together(config).error(), HasSubstr("max_node_px"));
}

TEST(ConfigIo, UpIsAVectorOrAuto) {
  const auto vector = parse_config("[body]\nup = [0, -1, 0]\n", "t");
  ASSERT_TRUE(vector) << vector.error();
  ASSERT_TRUE(vector->body.up);
  EXPECT_EQ((*vector->body.up)[1], -1.0);
  EXPECT_TRUE(parse_config("[body]\nup = \"auto\"\n", "t"));
  EXPECT_THAT(error_of("[body]\nup = [0, 0, 0]\n"), HasSubstr("body.up"));
  EXPECT_THAT(error_of("[body]\nup = [0, 1]\n"), HasSubstr("body.up"));
}

TEST(ConfigIo, WhatItPrintsItReads) {
  Config config;
  ASSERT_TRUE(set_key(config, "frame.budget_us=12345"));
  ASSERT_TRUE(set_key(config, "input.source=tum:/data/with \"quotes\""));
  ASSERT_TRUE(set_key(config, "body.up=[0, -1, 0]"));
  const std::string text = print_config(config);
  const auto back = parse_config(text, "printed");
  ASSERT_TRUE(back) << back.error();
  EXPECT_EQ(print_config(*back), text);
  EXPECT_EQ(back->input.source, "tum:/data/with \"quotes\"");
}

TEST(ConfigIo, APoseIsAListOrText) {
  const std::string camera = "[gray_camera]\nsource = \"libcamera:\"\nfx_px = 500.0\nfy_px = 500\n";
  for (const char* pose : {"", "T_depth_gray = [0.025, 0, -0.1, 0, 0, 0, 1]\n",
                           "T_depth_gray = \"0.025, 0, -0.1, 0, 0, 0, 1\"\n"}) {
    const auto config = parse_config(camera + pose, "t");
    ASSERT_TRUE(config) << config.error();
    EXPECT_TRUE(check_together(*config)) << pose;
  }
  for (const char* pose : {"[0, 0, 0, 0, 0, 0, 2]", "[0, 0, 0, 0, 0, 1]", "\"0,0,0,0,0,0,1,\"",
                           "\"here\"", "[0, 0, nan, 0, 0, 0, 1]"}) {
    const auto config = parse_config(camera + "T_depth_gray = " + pose + "\n", "t");
    ASSERT_TRUE(config) << config.error();
    const auto checked = check_together(*config);
    ASSERT_FALSE(checked) << pose;
    EXPECT_THAT(checked.error(), HasSubstr("gray_camera.T_depth_gray"));
  }
  EXPECT_THAT(error_of("[gpio]\nhold = [1, 2]\n"), HasSubstr("gpio.hold"));
}

TEST(ConfigIo, AGrayCameraNeedsItsIntrinsicsAndAScheme) {
  Config config;
  ASSERT_TRUE(set_key(config, "gray_camera.source=libcamera:"));
  EXPECT_THAT(check_together(config).error(), HasSubstr("calibrate"));
  ASSERT_TRUE(set_key(config, "gray_camera.source=v4l2:"));
  EXPECT_THAT(check_together(config).error(), HasSubstr("libcamera:ID"));
}

TEST(ConfigIo, SetSaysWhatIsWrong) {
  Config config;
  EXPECT_THAT(set_key(config, "frame.budget_us").error(), HasSubstr("key=value"));
  EXPECT_THAT(set_key(config, "frame.budget=1").error(), HasSubstr("unknown key"));
  EXPECT_THAT(set_key(config, "=1").error(), HasSubstr("--set"));
}

}  // namespace
}  // namespace maplet::daemon
