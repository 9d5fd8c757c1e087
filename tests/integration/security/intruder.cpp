// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Somebody on the link who should not be there, with the real DDS:
//
//   intruder INTERFACE wifi|radio DOMAIN SECONDS plain             says records without a seal
//   ...                                          capture FILE      keeps every frame that it hears
//   ...                                          replay FILE       says them again
//   ...                                          speak KEYS        with the keys in a folder,
//   whoever
//                                                                  revoked them
//   ...                                          speak KEYS CERTS  the same, in DDS Security
//
// One line of JSON at the end: what it heard, what it could read, what it said.
#include <fmt/core.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "tests/support/records.hpp"
#include "transport/dds/radio.hpp"
#include "transport/exchange/datagram.hpp"
#include "transport/exchange/record_codec.hpp"
#include "transport/security/guard.hpp"
#include "transport/security/key_files.hpp"

namespace {

using namespace maplet;
using namespace std::chrono_literals;

constexpr std::uint16_t kAgent = 9;

class Intruder final : public FrameTaker {
 public:
  Intruder(std::unique_ptr<DdsRadio> radio, bool slow) : radio_{std::move(radio)}, slow_{slow} {}

  void take_keys(const AgentKeys& keys) {
    agent_ = keys.agent;
    guard_.emplace(Guard::Config{2'000'000'000, slow_ ? Duration{4s} : Duration{800ms}, 64}, keys,
                   arena_);
    guard_->set_wall_clock(std::chrono::system_clock::to_time_t(std::chrono::system_clock::now()));
  }

  void take(std::span<const std::byte> frame) noexcept override {
    ++heard_;
    if (keep_) kept_.emplace_back(frame.begin(), frame.end());
    if (DatagramReader{frame}.fault() == DatagramFault::kNone) ++readable_;
    // Whoever stole keys is not going to listen to the operator.
    if (!guard_ || frame[0] == static_cast<std::byte>(FrameKind::kNotice)) return;
    if (!guard_->open(frame, clock_.now()).empty()) ++readable_;
  }

  void listen(Duration time) {
    for (const Instant end = clock_.now() + time; clock_.now() < end;) {
      (void)radio_->receive(20ms, *this);
      talk();
    }
  }
  void wait_for_listeners() {
    for (int i = 0; i < 160 && radio_->listeners() < 2; ++i) listen(50ms);
    listen(2s);  // in DDS Security they have our keys somewhat later
  }
  void say(std::span<const std::byte> frame) {
    const bool heard = radio_->listeners() > 0;
    if (!frame.empty() && radio_->write(Traffic::kDeltaPoses, frame) && heard) ++said_;
  }
  void say_records(Duration time) {
    for (const Instant end = clock_.now() + time; clock_.now() < end; listen(100ms)) {
      std::array<std::byte, 400> buffer{};
      DatagramWriter out{buffer, {{agent_, 77}, static_cast<std::uint16_t>(seq_)}};
      std::mt19937 dice{seq_};
      const auto record = quantise(test::random_delta(dice, agent_, 77, seq_), agent_, 77, seq_);
      seq_ = (seq_ + 1) % 5;  // again and again: the first ones may come before a proof
      std::array<std::byte, kMaxRecordBytes> body{};
      ByteWriter writer{body};
      RecordContext context{agent_, 77};
      write_record(writer, context, *record);
      (void)out.add(EntryKind::kDeltaPose, std::span{body}.first(writer.size()));
      const auto plain = out.finish();
      say(guard_ ? guard_->seal(plain) : plain);
    }
  }
  void keep(const std::string& file, Duration time) {
    keep_ = true;
    listen(time);
    std::ofstream out{file, std::ios::binary};
    for (const auto& frame : kept_) {
      const auto size = static_cast<std::uint16_t>(frame.size());
      out.write(reinterpret_cast<const char*>(&size), sizeof size);
      out.write(reinterpret_cast<const char*>(frame.data()), size);
    }
  }
  void replay(const std::string& file) {
    std::ifstream in{file, std::ios::binary};
    std::uint16_t size = 0;
    while (in.read(reinterpret_cast<char*>(&size), sizeof size)) {
      std::vector<std::byte> frame(size);
      in.read(reinterpret_cast<char*>(frame.data()), size);
      say(frame);
      listen(20ms);
    }
  }
  void report() const {
    fmt::print("{{\"heard\": {}, \"readable\": {}, \"said\": {}, \"listeners\": {}}}\n", heard_,
               readable_, said_, radio_->listeners());
  }

 private:
  void talk() {
    if (!guard_) return;
    const auto frame = guard_->next(clock_.now());
    if (!frame.empty()) (void)radio_->write(Traffic::kControl, frame);
  }

  MonotonicClock clock_;
  std::unique_ptr<DdsRadio> radio_;
  bool slow_;
  Arena arena_{std::size_t{1} << 22};
  std::optional<Guard> guard_;
  std::uint16_t agent_ = kAgent;
  std::uint32_t seq_ = 0;
  bool keep_ = false;
  std::vector<std::vector<std::byte>> kept_;
  int heard_ = 0;
  int readable_ = 0;
  int said_ = 0;
};

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> words(argv + 1, argv + argc);
  if (words.size() < 5) return 2;
  RadioConfig config;
  config.interface = words[0];
  config.profile = words[1];
  const auto time = std::chrono::milliseconds{std::lround(std::stod(words[3]) * 1e3)};
  const std::string what = words[4];
  const DdsSecurityFiles certificates{words.size() > 6 ? words[6] : ""};
  auto radio =
      DdsRadio::open(config, std::stoi(words[2]), 9, words.size() > 6 ? &certificates : nullptr);
  if (!radio) {
    fmt::print(stderr, "intruder: {}\n", radio.error().what);
    return 1;
  }
  Intruder intruder{std::move(*radio), config.profile == "radio"};
  if (what == "speak") {
    const auto keys = load_agent_keys(words.at(5));
    if (!keys) {
      fmt::print(stderr, "intruder: {}\n", keys.error());
      return 1;
    }
    intruder.take_keys(*keys);
  }
  if (what == "capture") {
    intruder.keep(words.at(5), time);
  } else if (what == "replay") {
    intruder.wait_for_listeners();
    intruder.replay(words.at(5));
    intruder.listen(1s);
  } else {
    intruder.wait_for_listeners();
    intruder.say_records(time);
    intruder.listen(1s);
  }
  intruder.report();
  return 0;
}
