// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/security/guard.hpp"

#include <gtest/gtest.h>

#include <set>

#include "tests/support/team.hpp"

namespace maplet {
namespace {

using test::copy;
using test::datagram;
using test::hear;
using test::Member;
using test::talk;
using test::Team;
using namespace std::chrono_literals;

struct Guards : testing::Test {
  Team team;
  Member a{team.keys(1)};
  Member b{team.keys(2)};
  Instant now{std::chrono::hours{1}};

  std::vector<std::byte> said(Member& from, std::string_view text = "hello") {
    return copy(from.guard.seal(datagram(from.guard.keys().agent, text)));
  }
  /// Both have said something, and know that the other is there now.
  void meet(Member& one, Member& other) {
    (void)hear(other, said(one), now);
    (void)hear(one, said(other), now);
    talk({&one, &other}, now, 2s);
  }
  static std::uint64_t refused(const Member& member, Refusal why) {
    return member.guard.counters().of(why);
  }
};

TEST_F(Guards, LetInWhoProvesToBeThere) {
  EXPECT_FALSE(hear(b, said(a), now)) << "it may be of yesterday";
  EXPECT_EQ(refused(b, Refusal::kUnproven), 1U);
  EXPECT_FALSE(hear(a, said(b), now));
  talk({&a, &b}, now, 1s);
  EXPECT_TRUE(b.guard.let_in());
  EXPECT_TRUE(hear(b, said(a, "now"), now));
  EXPECT_TRUE(hear(a, said(b), now));
  EXPECT_EQ(b.heard.back(), "now");
  EXPECT_EQ(b.guard.counters().all_refused(), 0U) << "it was nobody's attempt";
  EXPECT_LE(a.guard.counters().talk_sent, 2U);
}

TEST_F(Guards, GiveTheDatagramBackAsItWas) {
  meet(a, b);
  const auto plain = datagram(1, "what was said");
  const auto sealed = copy(a.guard.seal(plain));
  EXPECT_EQ(sealed.size(), plain.size() + kSealBytes);
  EXPECT_EQ(copy(b.guard.open(sealed, now)), plain);
}

TEST_F(Guards, TakeEachFrameOnce) {
  meet(a, b);
  std::vector<std::vector<std::byte>> frames;
  for (int i = 0; i < 40; ++i) frames.push_back(said(a));
  for (auto it = frames.rbegin(); it != frames.rend(); ++it) EXPECT_TRUE(hear(b, *it, now));
  for (const auto& frame : frames) EXPECT_FALSE(hear(b, frame, now));
  EXPECT_EQ(refused(b, Refusal::kReplayed), 40U);
}

TEST_F(Guards, DoNotBelieveARecordingAfterARestart) {
  meet(a, b);
  std::vector<std::vector<std::byte>> recorded;
  for (int i = 0; i < 10; ++i) recorded.push_back(said(a));
  (void)hear(b, said(a), now);
  Member again{b.guard.keys()};  // b without a memory
  for (const auto& frame : recorded) EXPECT_FALSE(hear(again, frame, now));
  talk({&again}, now, 100s);
  for (const auto& frame : recorded) EXPECT_FALSE(hear(again, frame, now));
  EXPECT_EQ(refused(again, Refusal::kUnproven), 20U);
  meet(a, again);  // a itself is let in, and what was recorded before is over
  for (const auto& frame : recorded) EXPECT_FALSE(hear(again, frame, now));
  EXPECT_TRUE(hear(again, said(a), now));
  EXPECT_EQ(refused(again, Refusal::kReplayed), 10U);
}

TEST_F(Guards, DoNotBelieveARecordedProof) {
  // Everything that a said while it met b, kept by somebody who plays it to b after its restart.
  std::vector<std::vector<std::byte>> recorded;
  (void)hear(b, said(a), now);
  for (int i = 0; i < 100; ++i, now += 20ms) {
    if (auto frame = copy(b.guard.next(now)); !frame.empty()) (void)hear(a, frame, now);
    if (auto frame = copy(a.guard.next(now)); !frame.empty()) {
      recorded.push_back(frame);
      (void)hear(b, frame, now);
    }
  }
  recorded.push_back(said(a));
  ASSERT_TRUE(hear(b, recorded.back(), now));
  Member again{b.guard.keys()};
  for (int round = 0; round < 3; ++round) {
    for (const auto& frame : recorded) EXPECT_FALSE(hear(again, frame, now));
    talk({&again}, now, 10s);
  }
  EXPECT_GT(refused(again, Refusal::kUnproven), 0U);
}

TEST_F(Guards, DoNotLockARestartedAgentOut) {
  meet(a, b);
  const auto before = said(a, "before");
  Member again{a.guard.keys()};
  (void)hear(b, said(again), now);
  talk({&again, &b}, now, 2s);
  EXPECT_TRUE(hear(b, said(again, "again"), now));
  EXPECT_FALSE(hear(b, before, now)) << "of the session that is over";
  EXPECT_EQ(refused(b, Refusal::kReplayed), 1U);
}

TEST_F(Guards, SayWhyTheyRefuse) {
  meet(a, b);
  EXPECT_FALSE(hear(b, datagram(9, "plain"), now));
  EXPECT_EQ(b.guard.counters().last_agent, 9);
  Team other;
  Member stranger{other.keys(1)};
  EXPECT_FALSE(hear(b, said(stranger), now));
  auto changed = said(a);
  changed[kFrameHeadBytes + 2] ^= std::byte{4};
  EXPECT_FALSE(hear(b, changed, now));
  EXPECT_FALSE(hear(b, std::span{changed}.first(10), now));
  auto mine = said(b);
  EXPECT_FALSE(hear(b, mine, now)) << "own words come back from nobody honest";
  EXPECT_EQ(refused(b, Refusal::kPlain), 1U);
  EXPECT_EQ(refused(b, Refusal::kForeign), 1U);
  EXPECT_EQ(refused(b, Refusal::kTampered), 2U);
  EXPECT_EQ(refused(b, Refusal::kReplayed), 1U);
  EXPECT_EQ(b.heard.size(), 0U);
}

TEST_F(Guards, PassTheNextKeysOnAndShutTheStolenOnesOut) {
  Member stolen{team.keys(3)};
  meet(a, b);
  meet(a, stolen);
  meet(b, stolen);
  const auto notice = team.rotate({3}).front();
  EXPECT_EQ(a.guard.take_notice(notice, now), Guard::Taken::kNew);
  // b knows nothing yet; what it says is old to a, which makes a tell it.
  EXPECT_FALSE(hear(a, said(b), now));
  EXPECT_EQ(refused(a, Refusal::kOldKey), 1U);
  talk({&a, &b, &stolen}, now, 5s);
  EXPECT_EQ(b.guard.keys().generation, 2U);
  EXPECT_TRUE(hear(a, said(b, "new"), now)) << "without another proof";
  EXPECT_TRUE(hear(b, said(a, "secret"), now));
  // The thief ignores what it heard, and goes on with the keys it has.
  Member thief{[&] {
    AgentKeys keys = stolen.guard.keys();
    keys.revoked.clear();
    keys.generation = 1;
    return keys;
  }()};
  for (int i = 0; i < 5; ++i) {
    EXPECT_FALSE(hear(a, said(thief), now));
    EXPECT_FALSE(hear(b, said(thief), now));
    EXPECT_FALSE(hear(thief, said(a), now));
  }
  EXPECT_EQ(refused(b, Refusal::kRevoked), 5U);
  EXPECT_EQ(refused(thief, Refusal::kNewerKey), 5U);
  EXPECT_EQ(stolen.guard.state(), Guard::State::kRevoked);
  EXPECT_TRUE(said(stolen).empty());
}

TEST_F(Guards, BelieveNobodyButTheOperatorAboutKeys) {
  Team forger = team;
  fill_random(forger.operator_key.bytes());
  auto forged = forger.rotate({1}).front();
  EXPECT_EQ(a.guard.take_notice(forged, now), Guard::Taken::kForeign);
  auto notice = team.rotate({2}).front();
  auto changed = notice;
  changed[12] ^= std::byte{1};  // another generation
  (void)hear(a, changed, now);
  EXPECT_EQ(refused(a, Refusal::kNotice), 1U);
  EXPECT_EQ(a.guard.keys().generation, 1U);
  EXPECT_EQ(a.guard.take_notice(notice, now), Guard::Taken::kNew);
  EXPECT_EQ(a.guard.take_notice(notice, now), Guard::Taken::kKnown);
  const auto newer = team.rotate().front();
  EXPECT_EQ(a.guard.take_notice(newer, now), Guard::Taken::kNew);
  (void)hear(a, notice, now);
  EXPECT_EQ(a.guard.keys().generation, 3U) << "there is no way back";
}

TEST_F(Guards, PassLargeTeamsTheirPart) {
  std::vector<std::unique_ptr<Member>> many;
  for (std::uint16_t agent = 10; agent < 60; ++agent) {
    many.push_back(std::make_unique<Member>(team.keys(agent)));
  }
  const auto notices = team.rotate();
  ASSERT_GE(notices.size(), 3U);
  for (const auto& notice : notices) (void)a.guard.take_notice(notice, now);
  talk({&a}, now, 60s);  // nobody was there
  Member& last = *many.back();
  EXPECT_FALSE(hear(a, said(last), now));
  talk({&a, &last}, now, 70s);
  EXPECT_EQ(last.guard.keys().generation, 2U);
  Member& first = *many.front();
  EXPECT_FALSE(hear(last, said(first), now));
  talk({&last, &first}, now, 300s);
  EXPECT_EQ(first.guard.keys().generation, 2U) << "from one who had it from another";
}

TEST_F(Guards, AnswerRecordingsWithFewBytes) {
  std::vector<std::vector<std::byte>> recorded;
  for (int i = 0; i < 50; ++i) recorded.push_back(said(a));
  const auto notice = team.rotate().front();
  (void)b.guard.take_notice(notice, now);
  std::size_t bytes = 0;
  for (const Instant start = now; now - start < 600s; now += 100ms) {
    (void)hear(b, recorded[static_cast<std::size_t>(now.time_since_epoch() / 100ms) % 50], now);
    bytes += b.guard.next(now).size();
  }
  EXPECT_LT(bytes, 600U * 12);  // bytes a second, for ever
}

TEST_F(Guards, StopWithTheDatesOfTheirKeys) {
  meet(a, b);
  b.guard.set_wall_clock(team.validity.not_after_s + 299);
  EXPECT_TRUE(hear(b, said(a), now));
  b.guard.set_wall_clock(team.validity.not_after_s + 301);
  EXPECT_FALSE(hear(b, said(a), now));
  EXPECT_TRUE(said(b).empty());
  EXPECT_EQ(b.guard.state(), Guard::State::kExpired);
  b.guard.set_wall_clock(0);
  EXPECT_FALSE(hear(b, said(a), now));
  EXPECT_EQ(b.guard.state(), Guard::State::kNotYet);
  EXPECT_EQ(refused(b, Refusal::kNoKeys), 2U);
}

TEST_F(Guards, StartANewSessionWhenTheCountersAreUsedUp) {
  Arena arena{std::size_t{1} << 20};
  Guard guard{{300, 800ms, 4, 10}, a.guard.keys(), arena};
  guard.set_wall_clock(Team::kNow);
  std::set<std::pair<std::uint64_t, std::uint32_t>> nonces;
  std::set<std::uint64_t> sessions;
  for (int i = 0; i < 35; ++i) {
    const auto head = read_frame_head(guard.seal(datagram(1, "x")));
    ASSERT_TRUE(head);
    EXPECT_LE(head->counter, 10U);
    EXPECT_TRUE(nonces.emplace(head->session, head->counter).second);
    sessions.insert(head->session);
  }
  EXPECT_EQ(sessions.size(), 4U);
}

}  // namespace
}  // namespace maplet
