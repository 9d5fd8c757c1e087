// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/swarm/swarm.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <stdexcept>

#include "tests/support/temp_dir.hpp"

namespace maplet::swarm {
namespace {

SwarmResult run(const SwarmConfig& config) {
  return Swarm{config}.run([](double) {});
}

SwarmConfig small() {
  SwarmConfig config;
  config.agents = 10;
  config.minutes = 15.0;
  config.solve = 3;
  return config;
}

std::string written(const std::string& name, const std::string& text) {
  static const test::TempDir dir;
  const std::string path = (dir / name).string();
  std::ofstream{path} << text;
  return path;
}

TEST(Swarm, AllHoldTheSameRecordsAndComeToTheSameSkeleton) {
  const SwarmResult result = run(small());
  EXPECT_TRUE(result.converged);
  EXPECT_GT(result.records, 140U);
  EXPECT_EQ(result.received, result.records * 9);
  ASSERT_EQ(result.solved.size(), 3U);
  EXPECT_TRUE(result.skeletons_equal());
  for (const Solved& solved : result.solved) EXPECT_LT(solved.error_m, 1.0);
  EXPECT_GT(result.exchange_bytes, 0U);
  EXPECT_GT(result.skeleton_bytes, 0U);
}

TEST(Swarm, TheSameSeedIsTheSameSwarm) {
  const SwarmResult once = run(small());
  const SwarmResult twice = run(small());
  EXPECT_EQ(once.bytes, twice.bytes);
  EXPECT_EQ(once.digest, twice.digest);
  SwarmConfig other = small();
  other.seed = 2;
  EXPECT_NE(run(other).digest, once.digest);
}

// Fifty agents meet two by two: beside its records a meeting needs little.
TEST(Swarm, ManyAgentsSayLittleMoreThanTheirRecords) {
  SwarmConfig config = small();
  config.agents = 50;
  config.solve = 0;
  config.minutes = 20.0;
  const SwarmResult result = run(config);
  EXPECT_TRUE(result.converged);
  EXPECT_LE(result.bytes_per_record(), 1.4 * result.record_bytes);
  EXPECT_LE(result.duplicates, result.received / 20);
}

TEST(Swarm, HearsThroughLossInCrowdsAndOnSlowRadios) {
  for (const char* contacts : {"near", "all"}) {
    SwarmConfig config = small();
    config.contacts = contacts;
    config.range_m = 40.0;
    config.loss = 0.3;
    EXPECT_TRUE(run(config).converged) << contacts;
  }
  SwarmConfig slow = small();
  slow.profile = "radio";
  slow.budget_bytes_per_s = 300.0;
  EXPECT_TRUE(run(slow).converged);
}

TEST(Swarm, WhoNeverMeetsDoesNotConverge) {
  SwarmConfig config = small();
  config.agents = 3;
  config.minutes = 5.0;
  config.most_minutes = 1.0;
  config.contacts = written("maplet_swarm_contacts", "# a meeting\n0 400 1 2\n");
  const SwarmResult result = run(config);
  EXPECT_FALSE(result.converged);
  EXPECT_NEAR(result.convergence_s, 60.0, 1.0);
  EXPECT_GT(result.received, 0U);
}

TEST(Swarm, WrongContactsAndWorldsAreSaidWithTheirLine) {
  const auto complaint = [](const std::string& contacts) {
    SwarmConfig config = small();
    config.contacts = contacts;
    try {
      Swarm swarm{config};
    } catch (const std::invalid_argument& e) {
      return std::string{e.what()};
    }
    return std::string{};
  };
  EXPECT_NE(complaint("/nowhere/at all").find("a file that can be read"), std::string::npos);
  EXPECT_NE(complaint("/tmp").find("is it a file?"), std::string::npos);
  EXPECT_NE(complaint(written("maplet_swarm_empty", "# later\n")).find("no meeting"),
            std::string::npos);
  for (const char* line : {"1 2 3", "0 10 1 99", "0 10 2 2", "10 0 1 2", "nan 4 1 2", "a b c d"}) {
    const std::string path = written("maplet_swarm_bad", std::string{"\n"} + line + "\n");
    EXPECT_NE(complaint(path).find(path + ":2: "), std::string::npos) << line;
  }
  SwarmConfig config = small();
  config.world = "sea";
  EXPECT_THROW(Swarm{config}, std::invalid_argument);
}

TEST(Swarm, OneAgentAloneIsASwarm) {
  SwarmConfig config = small();
  config.agents = 1;
  const SwarmResult result = run(config);
  EXPECT_TRUE(result.converged);
  EXPECT_EQ(result.received, 0U);
  EXPECT_EQ(result.solved.size(), 1U);
}

}  // namespace
}  // namespace maplet::swarm
