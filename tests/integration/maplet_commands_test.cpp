// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// show, export, register and match: what they print, and what they say about files that are none.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "core/maplet/codec.hpp"
#include "tests/support/maplets.hpp"
#include "tests/support/run.hpp"
#include "tests/support/temp_dir.hpp"

namespace maplet::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;
namespace fs = std::filesystem;

class MapletCommands : public testing::Test {
 protected:
  TempDir dir_;
  const Se3 T_world_a_ = camera_at({2.0, 2.5, 1.2}, 0.2);
  const Se3 T_world_b_ = camera_at({2.4, 2.3, 1.25}, 0.4);

  std::string write(const std::string& name, const std::vector<Wall>& walls, const Se3& T,
                    std::uint16_t agent = 1) {
    auto maplet = std::make_unique<Maplet>();
    fill(*maplet, walls, T);
    maplet->key = {agent, 7, 3};
    maplet->stamp = std::chrono::seconds{12 + agent};
    std::vector<std::byte> bytes(kMaxMapletBytes);
    const auto size = encode(*maplet, bytes);
    EXPECT_TRUE(size);
    bytes.resize(*size);
    return write(name, bytes);
  }
  std::string write(const std::string& name, const std::vector<std::byte>& bytes) {
    const fs::path file = dir_.path() / name;
    std::ofstream{file, std::ios::binary}.write(reinterpret_cast<const char*>(bytes.data()),
                                                static_cast<std::streamsize>(bytes.size()));
    return file.string();
  }
  static std::vector<std::byte> bytes_of(const std::string& file) {
    const std::string text = text_of(file);
    const auto* first = reinterpret_cast<const std::byte*>(text.data());
    return {first, first + text.size()};
  }
  static json result(const std::vector<std::string>& command) {
    const Finished done = run(command);
    EXPECT_EQ(done.exit_code, 0) << done.err;
    return done.exit_code == 0 ? json::parse(done.out) : json{};
  }
};

TEST_F(MapletCommands, ShowTellsWhatAFileHolds) {
  const std::string file = write("a.maplet", room(), T_world_a_);
  const json shown = result({"mapletctl", "show", file, "--json"});
  EXPECT_EQ(shown["agent"], 1);
  EXPECT_EQ(shown["epoch"], 7);
  EXPECT_EQ(shown["id"], 3);
  EXPECT_EQ(shown["stamp_s"], 13.0);
  EXPECT_EQ(shown["bytes"], fs::file_size(file));
  ASSERT_EQ(shown["keyframes"].size(), 1U);
  EXPECT_EQ(shown["keyframes"][0]["T_maplet_camera"].size(), 7U);
  ASSERT_EQ(shown["planes"].size(), room().size());
  for (const json& plane : shown["planes"]) {
    EXPECT_EQ(plane["n"].size(), 3U);
    EXPECT_GT(plane["area_m2"].get<double>(), 0.0);
    EXPECT_GT(plane["cells"].get<int>(), 0);
    EXPECT_TRUE(plane.contains("id") && plane.contains("d"));
  }
}

TEST_F(MapletCommands, ExportWritesAMeshAndATrajectory) {
  const std::string file = write("a.maplet", room(), T_world_a_);
  const std::string ply = (dir_.path() / "a.ply").string();
  const std::string tum = (dir_.path() / "a.tum").string();
  EXPECT_EQ(run({"mapletctl", "export", file, "--ply", ply, "--tum", tum}).exit_code, 0);
  EXPECT_EQ(text_of(ply).substr(0, 4), "ply\n");
  EXPECT_GT(fs::file_size(ply), 1000U);
  EXPECT_THAT(text_of(tum), HasSubstr("13.000000000 0.000000"));
  EXPECT_EQ(run({"mapletctl", "export", file}).exit_code, 2);
  EXPECT_EQ(run({"mapletctl", "export", file, "--g2o", ply}).exit_code, 2);
}

// Walls in squares: more planes than the first layer has room for.
TEST_F(MapletCommands, ExportWritesCoarserMaplets) {
  std::vector<Wall> squares;
  for (const Wall& wall : room()) {
    for (const double x : {-0.75, -0.25, 0.25, 0.75}) {
      for (const double y : {-0.75, -0.25, 0.25, 0.75}) {
        const Eigen::Vector3d step = 0.02 * wall.normal() * (x + y);  // not in one plane
        squares.push_back({wall.centre + x * wall.half_a + y * wall.half_b + step,
                           0.2 * wall.half_a, 0.2 * wall.half_b});
      }
    }
  }
  if (squares.size() > kMaxMapletPlanes) squares.resize(kMaxMapletPlanes);
  const std::string file = write("a.maplet", squares, T_world_a_);
  const std::string coarse = (dir_.path() / "coarse.maplet").string();
  EXPECT_EQ(run({"mapletctl", "export", file, "--maplet", coarse, "--max-bytes", "1100"}).exit_code,
            0);
  EXPECT_LE(fs::file_size(coarse), 1100U);
  const json whole = result({"mapletctl", "show", file, "--json"});
  const json part = result({"mapletctl", "show", coarse, "--json"});
  EXPECT_EQ(whole["complete"], true);
  EXPECT_EQ(part["complete"], false);
  EXPECT_GT(part["planes"].size(), 3U);
  EXPECT_LT(part["planes"].size(), whole["planes"].size());
  const json found = result({"mapletctl", "register", file, coarse, "--json"});
  EXPECT_NE(found["verdict"], "reject") << found.dump();  // squares fit squares elsewhere, too
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(found["T_a_b"][i].get<double>(), 0.0, 1e-3);

  const std::string copy = (dir_.path() / "copy.maplet").string();
  EXPECT_EQ(run({"mapletctl", "export", file, "--maplet", copy}).exit_code, 0);
  EXPECT_EQ(text_of(copy), text_of(file));
  const Finished small = run({"mapletctl", "export", file, "--maplet", copy, "--max-bytes", "100"});
  EXPECT_EQ(small.exit_code, 1);
  EXPECT_THAT(small.err, HasSubstr("its first layer is"));
  EXPECT_EQ(text_of(copy), text_of(file));  // left alone
  EXPECT_EQ(run({"mapletctl", "export", dir_.path().string(), "--maplet", copy}).exit_code, 2);
}

TEST_F(MapletCommands, RegisterFindsTheTransform) {
  const std::string a = write("a.maplet", room(), T_world_a_);
  const std::string b = write("b.maplet", room(), T_world_b_, 2);
  const Se3 truth = T_world_a_.inverse() * T_world_b_;
  const json found = result({"mapletctl", "register", a, b, "--guess", "0,0,0,0,0,0,1", "--json"});
  EXPECT_EQ(found["verdict"], "accept") << found.dump();
  ASSERT_EQ(found["T_a_b"].size(), 7U);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(found["T_a_b"][i].get<double>(), truth.t[i], 2e-3);
  EXPECT_EQ(found["covariance"].size(), 36U);
  EXPECT_TRUE(found["free_axes"].empty());
  EXPECT_EQ(found["stop"], "converged");
  for (const char* key : {"reason", "matches", "overlap", "iterations", "us"}) {
    EXPECT_TRUE(found.contains(key)) << key;
  }
  // With no guess it is found as well, but another room may look like this one.
  const json alone = result({"mapletctl", "register", a, b, "--json"});
  EXPECT_EQ(alone["verdict"], "undecided") << alone.dump();
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(alone["T_a_b"][i].get<double>(), truth.t[i], 2e-3);
  const json hasty = result({"mapletctl", "register", a, b, "--json", "--budget-us", "1"});
  EXPECT_EQ(hasty["stop"], "deadline");
  EXPECT_NE(hasty["verdict"], "accept");
}

// Whatever little there is: a verdict with its reason, never an acceptance.
TEST_F(MapletCommands, PoorMapletsGetAReasonedVerdict) {
  const std::string full = write("full.maplet", room(), T_world_a_);
  const std::vector<std::vector<Wall>> poor{
      {}, {room()[2]}, {room()[0], room()[7]}, {room()[0], room()[1], room()[7]}};
  for (std::size_t i = 0; i < poor.size(); ++i) {
    const std::string file = write(std::to_string(i) + ".maplet", poor[i], T_world_a_);
    for (const std::string& other : {full, file}) {
      const json found = result({"mapletctl", "register", file, other, "--json"});
      EXPECT_NE(found["verdict"], "accept") << i << found.dump();
      EXPECT_FALSE(found["reason"].get<std::string>().empty());
    }
  }
  // One wall alone says how far away it is and how it is turned, and that it says no more.
  const json wall =
      result({"mapletctl", "register", (dir_.path() / "1.maplet").string(), full, "--json"});
  EXPECT_EQ(wall["free_axes"].size(), 3U) << wall.dump();
  const json same = result({"mapletctl", "register", full, full, "--json"});
  EXPECT_EQ(same["verdict"], "accept") << same.dump();
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(same["T_a_b"][i].get<double>(), 0.0, 1e-6);
}

TEST_F(MapletCommands, FilesThatAreNoMapletsAreNamed) {
  const std::string good = write("good.maplet", room(), T_world_a_);
  const auto bytes = bytes_of(good);
  auto cut = bytes;
  cut.resize(bytes.size() / 2);
  auto flipped = bytes;
  flipped[bytes.size() / 2] ^= std::byte{4};
  auto newer = bytes;
  newer[4] = std::byte{99};
  const std::vector<std::pair<std::string, std::string>> bad{
      {write("empty.maplet", std::vector<std::byte>{}), ""},
      {write("cut.maplet", cut), ""},
      {write("flipped.maplet", flipped), ""},
      {write("newer.maplet", newer), "version"},
      {write("text.maplet", std::vector<std::byte>(5000, std::byte{'x'})), ""},
      {(dir_.path() / "missing.maplet").string(), ""},
      {dir_.path().string(), ""}};
  for (const auto& [file, reason] : bad) {
    for (const auto& command :
         std::vector<std::vector<std::string>>{{"mapletctl", "show", file},
                                               {"mapletctl", "register", file, good},
                                               {"mapletctl", "register", good, file}}) {
      const Finished done = run(command);
      EXPECT_EQ(done.exit_code, 1) << file;
      EXPECT_THAT(done.err, HasSubstr(file));
      EXPECT_THAT(done.err, HasSubstr(reason));
      EXPECT_EQ(std::count(done.err.begin(), done.err.end(), '\n'), 1) << done.err;
    }
  }
}

TEST_F(MapletCommands, GuessesThatAreNoneAreUsageErrors) {
  const std::string a = write("a.maplet", room(), T_world_a_);
  for (const char* guess : {"nan,0,0,0,0,0,1", "0,0,0,0,0,0,0", "0,0,0,1,1,1,1", "1,2,3", "x"}) {
    const Finished done = run({"mapletctl", "register", a, a, "--guess", guess});
    EXPECT_EQ(done.exit_code, 2) << guess << done.err;
  }
  EXPECT_EQ(run({"mapletctl", "register", a, a, "--budget-us", "-1"}).exit_code, 2);
  const json far = result({"mapletctl", "register", a, a, "--guess", "1e6,0,0,0,0,0,1", "--json"});
  EXPECT_EQ(far["verdict"], "reject");
}

// One damaged file costs its own maplet only, and is said.
TEST_F(MapletCommands, MatchGoesOnWithoutADamagedFile) {
  for (const char* name : {"x/maplets", "y/maplets"}) fs::create_directories(dir_.path() / name);
  (void)write("x/maplets/0000.maplet", room(), T_world_a_);
  (void)write("y/maplets/0000.maplet", room(), T_world_b_, 2);
  const std::string damaged = write("y/maplets/0001.maplet", std::vector<std::byte>(50));
  std::ofstream{dir_.path() / "y" / "skeleton.g2o"} << "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n";
  const std::vector<std::string> both{(dir_.path() / "x").string(), (dir_.path() / "y").string()};
  const Finished done = run({"mapletctl", "match", both[0], both[1], "--json"});
  EXPECT_EQ(done.exit_code, 1);
  EXPECT_THAT(done.err, HasSubstr(damaged));
  EXPECT_EQ(json::parse(done.out)["a"], "0000") << done.out;
  for (const char* side : {"x", "y"}) {
    (void)write(std::string{side} + "/maplets/0000.maplet", std::vector<std::byte>(50));
  }
  EXPECT_EQ(run({"mapletctl", "match", both[0], both[1]}).exit_code, 1);
}

TEST_F(MapletCommands, MatchWantsFoldersWithMaplets) {
  const fs::path empty = dir_.path() / "empty";
  fs::create_directories(empty);
  const Finished none = run({"mapletctl", "match", empty.string(), empty.string()});
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_THAT(none.err, HasSubstr("holds no maplets"));
  for (const char* command : {"match", "export"}) {
    std::vector<std::string> words{"mapletctl", command, "/no/such/folder"};
    if (words[1] == "match") words.push_back(empty.string());
    if (words[1] == "export") words.insert(words.end(), {"--ply", (empty / "x.ply").string()});
    const Finished missing = run(words);
    EXPECT_EQ(missing.exit_code, 1) << command;
    EXPECT_THAT(missing.err, HasSubstr("/no/such/folder: No such file or directory")) << command;
  }
}

}  // namespace
}  // namespace maplet::test
