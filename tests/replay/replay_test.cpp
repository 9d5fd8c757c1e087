// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Whole missions through the real programs: the same bytes twice, and the promised accuracy.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "tests/support/recordings.hpp"
#include "tests/support/run.hpp"
#include "tests/support/temp_dir.hpp"

namespace maplet::test {
namespace {

namespace fs = std::filesystem;

std::set<std::string> files_below(const fs::path& folder) {
  std::set<std::string> names;
  for (const auto& entry : fs::recursive_directory_iterator{folder}) {
    if (entry.is_regular_file()) names.insert(fs::relative(entry.path(), folder).string());
  }
  return names;
}

/// report.json without what the clock and the allocator decide.
nlohmann::json decided_by_input(const fs::path& out) {
  nlohmann::json report = report_of(out);
  report.erase("memory");
  for (auto& [name, stage] : report["stages"].items()) stage = stage["count"];
  return report;
}

TEST(Replay, TwoRunsAreBitIdentical) {
  const TempDir dir;
  const std::string source = "sim:loop?seed=5&frames=240&width=320";
  for (const char* name : {"a", "b"}) {
    const Finished mapped = map_it(source, dir / name);
    ASSERT_EQ(mapped.exit_code, 0) << mapped.err;
  }
  const auto names = files_below(dir / "a");
  EXPECT_EQ(names, files_below(dir / "b"));
  for (const char* promised :
       {"odometry.tum", "trajectory.tum", "skeleton.g2o", "map.ply", "map.svg", "map.png",
        "delta_poses.jsonl", "report.json", "maplets/0000.maplet"}) {
    EXPECT_TRUE(names.contains(promised)) << promised;
  }
  for (const std::string& name : names) {
    if (name == "report.json") continue;
    EXPECT_EQ(text_of(dir / "a" / name), text_of(dir / "b" / name)) << name << " differs";
  }
  EXPECT_EQ(decided_by_input(dir / "a"), decided_by_input(dir / "b"));
}

TEST(Replay, AnotherSeedIsAnotherRun) {
  const TempDir dir;
  for (const char* seed : {"1", "2"}) {
    ASSERT_EQ(
        map_it(std::string{"sim:room?frames=20&width=320&seed="} + seed, dir / seed).exit_code, 0);
  }
  EXPECT_NE(text_of(dir / "1" / "odometry.tum"), text_of(dir / "2" / "odometry.tum"));
}

TEST(Replay, SimulatedLoopStaysWithinOnePercent) {
  const TempDir dir;
  const std::string world = "sim:loop?seed=11&width=320&rate_hz=30";
  ASSERT_EQ(run({"mapletctl", "simulate", world, "--out", (dir / "truth").string(), "--truth-only"},
                std::chrono::seconds{300})
                .exit_code,
            0);
  const Finished mapped = map_it(world, dir / "out");
  ASSERT_EQ(mapped.exit_code, 0) << mapped.err;
  const auto errors = errors_of(dir / "out", "trajectory.tum", dir / "truth" / "groundtruth.txt");
  EXPECT_GE(errors["path_m"], 40.0);
  EXPECT_LE(errors["ate_rms_m"].get<double>(), 0.01 * errors["path_m"].get<double>());
  const auto report = report_of(dir / "out");
  EXPECT_EQ(report["tracking"]["lost"], 0);
  EXPECT_LE(report["maplets"]["bytes_mean"], 8192);
}

// Gray leads to the nearest likeness: from farther away only patches may. With stamps before zero.
TEST(Replay, GrayDoesNotLeadAstrayAcrossGaps) {
  const TempDir dir;
  const fs::path walk = dir / "walk";
  ASSERT_EQ(run({"mapletctl", "simulate", "sim:room?seed=4&frames=300&width=320&speed_m_per_s=0.4",
                 "--out", walk.string()},
                std::chrono::seconds{120})
                .exit_code,
            0);
  for (const char* name : {"depth.txt", "rgb.txt", "groundtruth.txt"}) {
    std::istringstream lines{text_of(walk / name)};
    std::ofstream shifted{walk / name};
    for (std::string line; std::getline(lines, line);) {
      const auto space = line.find(' ');
      if (line.starts_with('#') || space == std::string::npos) continue;
      shifted << fmt::format("{:.6f}{}\n", std::stod(line.substr(0, space)) - 5.0,
                             line.substr(space));
    }
  }
  const Finished mapped = map_it("tum:" + walk.string() + "?every=15", dir / "out");
  ASSERT_EQ(mapped.exit_code, 0) << mapped.err;
  const auto report = report_of(dir / "out");
  EXPECT_EQ(report["tracking"]["lost"], 0);
  EXPECT_GE(report["tracking"]["with_gray"], 10);
  const auto errors = errors_of(dir / "out", "odometry.tum", walk / "groundtruth.txt");
  EXPECT_LE(errors["ate_rms_m"], 0.010);
  EXPECT_GE(errors["path_m"], 2.0);
}

/// The figures that every recording's run must have.
void expect_compact(const nlohmann::json& report) {
  EXPECT_LE(report["maplets"]["bytes_mean"].get<double>(), 8192);
  EXPECT_LE(report["maplets"]["bytes_max"].get<double>(), 8192);
  EXPECT_GE(report["maplets"]["point_cloud_bytes_mean"].get<double>(),
            200 * report["maplets"]["bytes_mean"].get<double>());
  EXPECT_LE(report["delta_poses"]["payload_bytes_mean"], 160);
  EXPECT_GT(report["maplets"]["kept"]["patches_placed"], 0);
  EXPECT_GT(report["maplets"]["kept"]["cells_seen_through"], 0);
  EXPECT_EQ(report["maplets"]["kept"]["looks_cut_short"], 0);
  EXPECT_LE(report["delta_poses"]["links"]["contradicted"], report["delta_poses"]["count"]);
}

TEST(Replay, RedKitchen) {
  MAPLET_RECORDING(folder, "rgbd/redkitchen_a");
  const TempDir dir;
  const Finished mapped = map_it("tum:" + folder.string(), dir / "out");
  ASSERT_EQ(mapped.exit_code, 0) << mapped.err;
  const auto report = report_of(dir / "out");
  EXPECT_EQ(report["frames"]["processed"], 500);
  EXPECT_EQ(report["tracking"]["lost"], 0);
  const auto errors = errors_of(dir / "out", "trajectory.tum", folder / "groundtruth.txt");
  EXPECT_LE(errors["ate_rms_m"], 0.080);
  EXPECT_LE(errors["rpe_1s"]["m"], 0.060);
  expect_compact(report);
}

TEST(Replay, StructureWithoutTexture) {
  MAPLET_RECORDING(folder, "rgbd/fr3_structure_notexture_far");
  const TempDir dir;
  const Finished mapped = map_it("tum:" + folder.string(), dir / "out");
  ASSERT_EQ(mapped.exit_code, 0) << mapped.err;
  EXPECT_EQ(report_of(dir / "out")["tracking"]["lost"], 0);
  const auto errors = errors_of(dir / "out", "trajectory.tum", folder / "groundtruth.txt");
  EXPECT_LE(errors["ate_rms_m"], 0.050);
  expect_compact(report_of(dir / "out"));
}

TEST(Replay, OniRecordingThroughTheRealRuntime) {
  MAPLET_RECORDING(oni, "oni/openni2_depth640_img320.oni");
  const TempDir dir;
  const Finished mapped = map_it("openni2:" + oni.string(), dir / "out");
  ASSERT_EQ(mapped.exit_code, 0) << mapped.err;
  EXPECT_EQ(report_of(dir / "out")["frames"]["processed"], 24);
}

}  // namespace
}  // namespace maplet::test
