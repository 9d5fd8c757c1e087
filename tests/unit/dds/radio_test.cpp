// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/dds/radio.hpp"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <set>
#include <thread>
#include <vector>

#include "tests/support/patience.hpp"
#include "tests/unit/dds/own_domain.hpp"

namespace maplet {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

struct Heard final : FrameTaker {
  std::vector<std::vector<std::byte>> all;
  void take(std::span<const std::byte> datagram) noexcept override {
    all.emplace_back(datagram.begin(), datagram.end());
  }
};

class Radio : public testing::TestWithParam<const char*> {};

/// Another process: says everything again that it hears.
pid_t start_echo(const RadioConfig& config, int domain) {
  const pid_t child = fork();
  if (child != 0) return child;
  struct Echo final : FrameTaker {
    DdsRadio* radio = nullptr;
    void take(std::span<const std::byte> datagram) noexcept override {
      (void)radio->write(static_cast<Traffic>(datagram[0]), datagram);
    }
  } echo;
  {
    auto radio = DdsRadio::open(config, domain, 2);
    if (!radio) _exit(1);
    echo.radio = radio->get();
    const MonotonicClock clock;
    for (const Instant end = clock.now() + seconds{20} * test::patience(); clock.now() < end;) {
      (*radio)->receive(milliseconds{100}, echo);
    }
  }
  _exit(0);
}

// Opening is the test of the shipped configuration: Cyclone refuses what it does not know.
TEST_P(Radio, CarriesDatagramsOfEveryKindBothWays) {
  RadioConfig config;
  config.profile = GetParam();
  const int domain = test::own_domain().domain;
  const pid_t other = start_echo(config, domain);
  auto radio = DdsRadio::open(config, domain, 1);
  ASSERT_TRUE(radio) << radio.error().what;
  EXPECT_TRUE((*radio)->interface_holds());
  const MonotonicClock clock;
  const Instant end = clock.now() + seconds{20} * test::patience();
  std::set<std::size_t> heard_lanes;
  while (heard_lanes.size() < kTraffics && clock.now() < end) {
    Heard heard;
    for (std::size_t lane = 0; lane < kTraffics; ++lane) {
      const std::vector<std::byte> datagram(1 + 240 * lane, static_cast<std::byte>(lane));
      EXPECT_TRUE((*radio)->write(static_cast<Traffic>(lane), datagram));
    }
    (*radio)->receive(milliseconds{200}, heard);
    for (const auto& datagram : heard.all) {  // nobody hears themselves: it is the echo
      EXPECT_EQ(datagram.size(), 1 + 240 * static_cast<std::size_t>(datagram[0]));
      heard_lanes.insert(static_cast<std::size_t>(datagram[0]));
    }
  }
  EXPECT_EQ(heard_lanes.size(), kTraffics);
  EXPECT_EQ((*radio)->listeners(), 1U);
  kill(other, SIGKILL);
  waitpid(other, nullptr, 0);
}

INSTANTIATE_TEST_SUITE_P(Profiles, Radio, testing::Values("wifi", "radio"));

TEST(RadioConfig, PeersMakeItUnicast) {
  RadioConfig config;
  config.peers = "127.0.0.1, 10.9.0.2";
  EXPECT_EQ(config.peer_list(), (std::vector<std::string>{"127.0.0.1", "10.9.0.2"}));
  for (const char* profile : {"wifi", "radio"}) {
    config.profile = profile;
    auto radio = DdsRadio::open(config, test::own_domain().domain, 3);
    ASSERT_TRUE(radio) << radio.error().what;
    EXPECT_EQ((*radio)->copies(), 1U);
  }
}

TEST(RadioConfig, DomainIsTheNextOne) {
  RadioConfig config;
  EXPECT_EQ(config.domain(0), 1);
  EXPECT_EQ(config.domain(230), 229);
  config.radio_domain = 7;
  EXPECT_EQ(config.domain(0), 7);
}

TEST(RadioConfig, SaysWhatCannotWork) {
  EXPECT_EQ(RadioConfig{}.problem(0), "");
  RadioConfig same;
  same.radio_domain = 3;
  EXPECT_EQ(same.problem(2), "");
  EXPECT_NE(same.problem(3).find("must differ from dds.domain"), std::string::npos);
  RadioConfig names;
  names.peers = "10.0.0.2, foo;bar";
  EXPECT_NE(names.problem(0).find("'foo;bar' is no IPv4 address"), std::string::npos);
  RadioConfig poor;  // 1092 bytes on the wire
  poor.budget_bytes_per_s = 291;
  EXPECT_NE(poor.problem(0).find("292 at least"), std::string::npos) << poor.problem(0);
  poor.budget_bytes_per_s = 292;
  EXPECT_EQ(poor.problem(0), "");
  poor.peers = "10.0.0.2 10.0.0.3";  // each datagram twice
  EXPECT_NE(poor.problem(0).find("to 2 peers"), std::string::npos);
  poor.profile = "radio";
  EXPECT_NE(poor.problem(0).find("306 at least"), std::string::npos) << poor.problem(0);
}

TEST(DdsRadio, MissingInterfaceCanBeTriedAgain) {
  RadioConfig config;
  config.interface = "no0such";
  const auto radio = DdsRadio::open(config, test::own_domain().domain, 1);
  ASSERT_FALSE(radio);
  EXPECT_EQ(radio.error().code, ErrorCode::kDevice);
}

TEST(DdsRadio, InterruptEndsTheWait) {
  auto radio = DdsRadio::open({}, test::own_domain().domain, 1);
  ASSERT_TRUE(radio) << radio.error().what;
  std::thread other{[&] {
    std::this_thread::sleep_for(milliseconds{50});
    (*radio)->interrupt();
  }};
  const MonotonicClock clock;
  const Instant start = clock.now();
  Heard heard;
  (*radio)->receive(seconds{20}, heard);
  EXPECT_LT(clock.now() - start, seconds{10});
  other.join();
}

}  // namespace
}  // namespace maplet
