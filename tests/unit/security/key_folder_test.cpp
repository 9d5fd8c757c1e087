// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/security/key_folder.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdlib>
#include <filesystem>

#include "tests/support/team.hpp"

namespace maplet {
namespace {

class KeyFolder : public testing::Test {
 protected:
  KeyFolder() {
    std::string name = testing::TempDir() + "keys-XXXXXX";
    dir_ = mkdtemp(name.data());
  }
  ~KeyFolder() override { std::filesystem::remove_all(dir_); }

  [[nodiscard]] std::string file() const { return dir_ + "/" + kNoticeFile; }
  [[nodiscard]] tl::expected<std::vector<Bytes>, std::string> load(const AgentKeys& keys,
                                                                   const std::string& text) const {
    EXPECT_EQ(write_file(file(), text, 0600), "");
    return load_notices(file(), keys);
  }

  std::string dir_;
  test::Team team_;
};

TEST_F(KeyFolder, WithoutNoticeSaysNothing) {
  const auto heard = load_notices(file(), team_.keys(1));
  ASSERT_TRUE(heard);
  EXPECT_TRUE(heard->empty());
}

TEST_F(KeyFolder, RefusesANoticeThatIsDamagedAnywhere) {
  std::vector<AgentKeys> robots;
  for (std::uint16_t agent = 0; agent < 30; ++agent) robots.push_back(team_.keys(agent));
  std::string text;
  for (const auto& part : team_.rotate({3})) text += notice_text(part);
  ASSERT_EQ(notices_begun(text), 2U);
  ASSERT_EQ(load(robots[1], text)->size(), 2U);
  EXPECT_FALSE(load(robots[1], ""));
  EXPECT_FALSE(load(robots[1], std::string(300, '\xa5')));
  const std::size_t end = text.find_last_not_of('\n');
  const std::size_t second = text.find("-----BEGIN", 1);
  for (std::size_t size = 0; size < end; ++size) {
    const std::string begin = "-----BEGIN MAPLET KEY NOTICE";
    if (size >= second - 1 && size < second + begin.size()) continue;  // a part alone is whole
    EXPECT_FALSE(load(robots[1], text.substr(0, size))) << size;
  }
  const std::size_t head = text.find('\n') + 1;
  for (std::size_t at = head; at < second - 30; at += 7) {
    std::string changed = text;
    if (changed[at] == '\n') ++at;
    changed[at] = changed[at] == 'A' ? 'B' : 'A';
    EXPECT_FALSE(load(robots[1], changed)) << at;
  }
}

TEST_F(KeyFolder, RefusesAnotherTeams) {
  test::Team other;
  (void)other.keys(1);
  const auto heard = load(team_.keys(1), notice_text(other.rotate({}).front()));
  ASSERT_FALSE(heard);
  EXPECT_NE(heard.error().find("another team's"), std::string::npos);
}

TEST_F(KeyFolder, StandsWhereTheNewestNoticePutsIt) {
  const AgentKeys one = team_.keys(1);
  const AgentKeys three = team_.keys(3);
  std::vector<Bytes> notices = team_.rotate({3});
  EXPECT_FALSE(standing(three, {}).revoked());
  EXPECT_TRUE(standing(three, notices).revoked());
  EXPECT_EQ(standing(three, notices).told, 2U);
  KeyStanding at = standing(one, notices);
  EXPECT_FALSE(at.revoked() || at.behind());
  EXPECT_EQ(at.keys.generation, 2U);
  EXPECT_EQ(at.keys.group, team_.group);
  const auto next = team_.rotate({});
  notices.insert(notices.begin(), next.begin(), next.end());  // the older one comes last
  at = standing(one, notices);
  EXPECT_EQ(at.keys.generation, 3U);
  EXPECT_EQ(at.keys.group, team_.group);
}

TEST_F(KeyFolder, WithoutAKeyInItIsBehind) {
  test::Team copy = team_;
  const AgentKeys late = copy.keys(9);  // the team that rotates does not know it
  (void)team_.keys(1);
  const KeyStanding at = standing(late, team_.rotate({}));
  EXPECT_TRUE(at.behind());
  EXPECT_FALSE(at.revoked());
  EXPECT_EQ(at.keys.generation, 1U);
}

TEST_F(KeyFolder, ThatOthersWriteInIsNotSafe) {
  EXPECT_EQ(folder_problem(dir_), "");
  for (const unsigned mode : {0777U, 0770U, 0702U}) {
    ASSERT_EQ(chmod(dir_.c_str(), mode), 0);
    EXPECT_NE(folder_problem(dir_).find("chmod 700"), std::string::npos) << mode;
  }
  ASSERT_EQ(chmod(dir_.c_str(), 0755), 0);
  EXPECT_EQ(folder_problem(dir_), "");
}

}  // namespace
}  // namespace maplet
