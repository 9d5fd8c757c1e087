// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/dds/domain.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <limits>
#include <optional>

#include "tests/unit/dds/own_domain.hpp"

namespace maplet {
namespace {

// Cyclone refuses an element it does not know or a value out of range: opening is the test of the
// shipped configuration.
TEST(DdsDomain, ShippedConfigurationIsAccepted) {
  auto domain = DdsDomain::open(test::own_domain(), DdsDomain::Role::kDaemon, 5);
  ASSERT_TRUE(domain) << domain.error().what;
  EXPECT_GT(domain->participant(), 0);
}

TEST(DdsDomain, IndexFollowsAgentAndWatchersComeAfter) {
  const DdsConfig config = test::own_domain();
  {
    auto daemon = DdsDomain::open(config, DdsDomain::Role::kDaemon, kDaemonIndices + 7);
    ASSERT_TRUE(daemon) << daemon.error().what;
    EXPECT_EQ(daemon->participant_index(), 7);
  }
  auto watcher = DdsDomain::open(config, DdsDomain::Role::kWatcher);
  ASSERT_TRUE(watcher) << watcher.error().what;
  EXPECT_EQ(watcher->participant_index(), kDaemonIndices);
}

TEST(DdsDomain, MissingInterfaceCanBeTriedAgain) {
  DdsConfig config = test::own_domain();
  config.interface = "no0such";
  const auto domain = DdsDomain::open(config, DdsDomain::Role::kDaemon);
  ASSERT_FALSE(domain);
  EXPECT_EQ(domain.error().code, ErrorCode::kDevice);
  EXPECT_NE(domain.error().what.find("no0such"), std::string::npos);
  EXPECT_EQ(domain.error().what.find('\n'), std::string::npos);
}

// Unescaped, the peer would be an element that Cyclone refuses; a peer that nobody can resolve it
// only passes over.
TEST(DdsDomain, WordsCannotBreakOutOfTheConfiguration) {
  DdsConfig config = test::own_domain();
  config.peers = {"\"/></Peers><Nonsense a=\"&<"};
  const auto domain = DdsDomain::open(config, DdsDomain::Role::kDaemon);
  EXPECT_TRUE(domain) << domain.error().what;
}

}  // namespace
}  // namespace maplet
