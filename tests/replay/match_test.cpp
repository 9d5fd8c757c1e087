// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Two agents that know nothing of each other, through the real programs: what mapletctl match
// finds.
#include <gtest/gtest.h>

#include <cmath>
#include <sstream>

#include "tests/support/run.hpp"
#include "tests/support/temp_dir.hpp"

namespace maplet {
namespace {

std::vector<nlohmann::json> match(const std::string& world, const test::TempDir& dir) {
  for (const char* agent : {"0", "1"}) {
    const test::Finished run =
        test::map_it("sim:" + world + "?rate_hz=15&agent=" + agent, dir.path() / agent,
                     {"--pace", "fast", "--agent", agent});
    EXPECT_EQ(run.exit_code, 0) << run.err;
  }
  const test::Finished found = test::run(
      {"mapletctl", "match", "--json", (dir.path() / "0").string(), (dir.path() / "1").string()});
  EXPECT_EQ(found.exit_code, 0) << found.err;
  std::vector<nlohmann::json> lines;
  std::istringstream in{found.out};
  for (std::string line; std::getline(in, line);) lines.push_back(nlohmann::json::parse(line));
  return lines;
}

// Both began somewhere in the room: most of their maplets see the same, and say how sure they are.
TEST(Match, TwoAgentsInARoomFindEachOther) {
  const test::TempDir dir;
  const auto lines = match("room", dir);
  ASSERT_FALSE(lines.empty());
  int accepted = 0;
  for (const auto& line : lines) {
    if (line["verdict"] != "accept") continue;
    ++accepted;
    EXPECT_EQ(line["a"].get<std::string>().size(), 4U);
    EXPECT_EQ(line["T_a_b"].size(), 7U);
    EXPECT_EQ(line["covariance"].size(), 36U);
    EXPECT_LT(std::sqrt(line["covariance"][0].get<double>()), 0.1);
  }
  EXPECT_GE(accepted, 10);

  // The folder of the maplets alone: its run's skeleton is beside it. Without one nothing is sure.
  const std::string maplets = (dir.path() / "0" / "maplets").string();
  const std::string other = (dir.path() / "1").string();
  EXPECT_NE(test::run({"mapletctl", "match", "--json", maplets, other}).out.find("\"accept\""),
            std::string::npos);
  std::filesystem::remove(dir.path() / "0" / "skeleton.g2o");
  const test::Finished unsure = test::run({"mapletctl", "match", "--json", maplets, other});
  EXPECT_EQ(unsure.exit_code, 0);
  EXPECT_EQ(unsure.out.find("\"accept\""), std::string::npos);
  EXPECT_NE(unsure.err.find("no skeleton.g2o"), std::string::npos) << unsure.err;
}

// Every view exists twice in there: nothing may be accepted, however well it fits.
TEST(Match, SymmetricRoomIsNeverAccepted) {
  const test::TempDir dir;
  for (const auto& line : match("symmetric", dir)) EXPECT_NE(line["verdict"], "accept");
}

}  // namespace
}  // namespace maplet
