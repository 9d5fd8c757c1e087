// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/dds/publisher.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <vector>

#include "core/limits.hpp"
#include "tests/support/records.hpp"
#include "tests/unit/dds/own_domain.hpp"

namespace maplet {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

TEST(DdsPublisher, WritesWhatItIsGiven) {
  auto publisher = DdsPublisher::start(test::own_domain(), 1, DdsPublisher::Missing::kFail);
  ASSERT_TRUE(publisher) << publisher.error().what;
  std::mt19937 rng{1};
  const std::vector<std::byte> bytes(kMaxMapletBytes);
  for (std::uint32_t i = 0; i < 10; ++i) {
    EXPECT_TRUE((*publisher)->publish(*quantise(test::random_delta(rng, 1, 2, i), 1, 2, i)));
  }
  for (std::uint32_t i = 0; i < 4; ++i) {
    EXPECT_TRUE((*publisher)->publish(MapletRecord{{1, 2, i}, Stamp{}, 0, 0, bytes}));
  }
  EXPECT_TRUE((*publisher)->publish(StatusRecord{}));
  EXPECT_TRUE((*publisher)->flush(seconds{10}));
  const auto counters = (*publisher)->counters();
  EXPECT_EQ(counters.delta_poses, 10U);
  EXPECT_EQ(counters.maplets, 4U);
  EXPECT_EQ(counters.statuses, 1U);
  EXPECT_EQ(counters.dropped, 0U);
  EXPECT_EQ(counters.failed, 0U);
}

TEST(DdsPublisher, CountsWhatDoesNotFit) {
  DdsConfig config = test::own_domain();
  config.interface = "no0such";  // nothing leaves the queues
  auto publisher = DdsPublisher::start(config, 1, DdsPublisher::Missing::kWait);
  ASSERT_TRUE(publisher) << publisher.error().what;
  EXPECT_FALSE((*publisher)->open());
  std::mt19937 rng{1};
  const auto record = *quantise(test::random_delta(rng), 1, 2, 0);
  std::uint64_t fitted = 0;
  while (fitted < 100000 && (*publisher)->publish(record)) ++fitted;
  EXPECT_GE(fitted, 256U);
  EXPECT_LT(fitted, 100000U);
  const std::vector<std::byte> bytes(kMaxMapletBytes + 1);
  EXPECT_FALSE((*publisher)->publish(MapletRecord{{1, 2, 3}, Stamp{}, 0, 0, bytes}));
  EXPECT_EQ((*publisher)->counters().dropped, 2U);
  EXPECT_FALSE((*publisher)->flush(milliseconds{20}));
}

TEST(DdsPublisher, FiniteRunRefusesMissingInterface) {
  DdsConfig config = test::own_domain();
  config.interface = "no0such";
  const auto publisher = DdsPublisher::start(config, 1, DdsPublisher::Missing::kFail);
  ASSERT_FALSE(publisher);
  EXPECT_EQ(publisher.error().code, ErrorCode::kDevice);
}

}  // namespace
}  // namespace maplet
