// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/security/key_notice.hpp"

#include <gtest/gtest.h>

#include "tests/support/team.hpp"
#include "transport/security/key_files.hpp"

namespace maplet {
namespace {

TEST(KeyNotice, GivesEachRobotThatStaysTheNextKey) {
  test::Team team;
  std::vector<AgentKeys> robots;
  for (std::uint16_t agent = 0; agent < 40; ++agent) robots.push_back(team.keys(agent));
  const auto parts = team.rotate({7, 20});
  ASSERT_EQ(parts.size(), 2U);
  for (const AgentKeys& keys : robots) {
    int found = 0;
    for (const auto& part : parts) {
      EXPECT_LE(part.size(), kMaxNoticeBytes);
      EXPECT_TRUE(signed_by(verifying_key(team.operator_key), part));
      const auto notice = read_key_notice(part);
      ASSERT_TRUE(notice);
      EXPECT_EQ(notice->generation, 2U);
      EXPECT_EQ(notice->validity, team.validity);
      const auto key = open_for(keys, *notice);
      if (!key) continue;
      ++found;
      EXPECT_EQ(*key, team.group);
    }
    EXPECT_EQ(found, keys.agent == 7 || keys.agent == 20 ? 0 : 1) << keys.agent;
  }
}

TEST(KeyNotice, IsOfNoUseToAnotherRobot) {
  test::Team team;
  const AgentKeys one = team.keys(1);
  AgentKeys other = team.keys(2);
  other.agent = 1;  // it says that it is 1
  const auto notice = read_key_notice(team.rotate({2}).front());
  ASSERT_TRUE(notice);
  EXPECT_EQ(*open_for(one, *notice), team.group);
  EXPECT_NE(*open_for(other, *notice), team.group);
}

TEST(KeyNotice, IsNotReadWhenItIsCutOrLonger) {
  test::Team team;
  for (std::uint16_t agent = 0; agent < 5; ++agent) (void)team.keys(agent);
  auto bytes = team.rotate({3}).front();
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    const auto cut = std::span{bytes}.first(size);
    EXPECT_FALSE(read_key_notice(cut) && signed_by(verifying_key(team.operator_key), cut));
  }
  bytes.push_back({});
  EXPECT_FALSE(read_key_notice(bytes));
}

TEST(AgentKeys, ComeBackFromTheirBytesAndFromNothingLess) {
  test::Team team;
  AgentKeys keys = team.keys(12);
  keys.revoked = {3, 65535};
  const auto bytes = to_bytes(keys, team.operator_key);
  const auto read = read_agent_keys(bytes);
  ASSERT_TRUE(read) << read.error();
  EXPECT_EQ(read->agent, 12);
  EXPECT_EQ(read->own, keys.own);
  EXPECT_EQ(read->group, keys.group);
  EXPECT_EQ(read->validity, keys.validity);
  EXPECT_EQ(read->revoked, keys.revoked);
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_FALSE(read_agent_keys(std::span{bytes}.first(size)));
  }
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    auto changed = bytes;
    changed[i] ^= std::byte{0x10};
    EXPECT_FALSE(read_agent_keys(changed)) << i;
  }
}

TEST(KeyFiles, FindNoticesAmongOtherText) {
  test::Team team;
  (void)team.keys(1);
  const auto first = team.rotate().front();
  const auto second = team.rotate().front();
  const auto found = notices_in("a word\n" + notice_text(first) + "\n# another\n" +
                                notice_text(second) + "-----BEGIN MAPLET KEY NOTICE-----\nAA");
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0], first);
  EXPECT_EQ(found[1], second);
}

TEST(Validity, SaysBothTimesAndTheTolerance) {
  const Validity validity{1'000'000'000, 1'000'000'100};
  EXPECT_EQ(problem(validity, 1'000'000'150, 60), "");
  EXPECT_EQ(problem(validity, 999'999'950, 60), "");
  const std::string late = problem(validity, 1'000'000'200, 60);
  EXPECT_NE(late.find("expired at 2001-09-09 01:48:20 UTC"), std::string::npos) << late;
  EXPECT_NE(late.find("2001-09-09 01:50:00 UTC (tolerance 60 s)"), std::string::npos) << late;
  EXPECT_NE(problem(validity, 0, 60).find("not valid before 2001-09-09 01:46:40 UTC"),
            std::string::npos);
  EXPECT_EQ(utc(-5), "1970-01-01 00:00:00 UTC");
}

}  // namespace
}  // namespace maplet
