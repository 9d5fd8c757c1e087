// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// A stand-in for mapletd: publishes `count` delta-poses, and a maplet for every tenth, through
// DdsPublisher and prints the delta-poses' JSON lines.
//     dds_publish DOMAIN AGENT COUNT [HOLD_MS [INTERFACE]]
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <thread>
#include <vector>

#include "tests/support/records.hpp"
#include "transport/dds/publisher.hpp"
#include "transport/exchange/json.hpp"

int main(int argc, char** argv) {
  using namespace maplet;
  if (argc < 4) return 2;
  DdsConfig config;
  config.domain = std::atoi(argv[1]);
  const auto agent = static_cast<std::uint16_t>(std::atoi(argv[2]));
  const auto count = static_cast<std::uint32_t>(std::atoi(argv[3]));
  const std::chrono::milliseconds hold{argc > 4 ? std::atoi(argv[4]) : 0};
  if (argc > 5) config.interface = argv[5];
  auto publisher = DdsPublisher::start(config, agent, DdsPublisher::Missing::kFail);
  if (!publisher) {
    std::fprintf(stderr, "%s\n", publisher.error().what.c_str());
    return 1;
  }
  std::mt19937 rng{agent};
  const std::vector<std::byte> bytes(5000, std::byte{42});
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto record = quantise(test::random_delta(rng, agent, 7, i), agent, 7, i);
    if (!record || !(*publisher)->publish(*record)) return 1;
    const JsonLine line = to_json(*record);
    std::printf("%.*s\n", static_cast<int>(line.size()), line.data());
    if (i % 10 != 0) continue;
    if (!(*publisher)->publish(MapletRecord{{agent, 7, i}, Stamp{i}, 3, 2, bytes})) return 1;
  }
  StatusRecord status;
  status.agent = agent;
  if (!(*publisher)->publish(status)) return 1;
  std::this_thread::sleep_for(hold);
  const bool flushed = (*publisher)->flush(std::chrono::seconds{5});
  const auto counters = (*publisher)->counters();
  publisher->reset();
  return flushed && counters.failed == 0 && counters.dropped == 0 ? 0 : 1;
}
