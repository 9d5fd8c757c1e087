// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// What security costs a datagram and a record: bytes, microseconds, allocations.
#include <fmt/core.h>

#include <chrono>
#include <cmath>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "core/base/crc.hpp"
#include "core/registration/delta_pose.hpp"
#include "tools/solve/heap_count.hpp"
#include "transport/exchange/record_codec.hpp"
#include "transport/security/guard.hpp"
#include "transport/sync/sync_config.hpp"

namespace {

using namespace maplet;

constexpr std::int64_t kNow = 1'800'000'000;

/// A delta-pose of a usual size.
DeltaPose delta_pose(std::mt19937& dice, std::uint32_t id) {
  std::normal_distribution<double> normal;
  DeltaPose delta;
  delta.a = {1, 7, id};
  delta.b = {1, 7, id + 1};
  delta.stamp_a = Stamp{1305031102175304000 + std::int64_t{id} * 1'033'000'000};
  delta.stamp_b = delta.stamp_a + Stamp{1'033'000'000};
  Matrix6d L = Matrix6d::Zero();
  Vector6d xi;
  for (int i = 0; i < 6; ++i) {
    xi[i] = normal(dice);
    for (int j = 0; j < i; ++j) L(i, j) = 1e-3 * normal(dice);
    L(i, i) = 1e-3 * (0.5 + std::abs(normal(dice)));
  }
  delta.T_a_b.se3 = Se3::exp(xi);
  delta.covariance = L * L.transpose();
  delta.overlap = 0.8F;
  delta.matches = 14;
  return delta;
}

/// An agent's guard with its memory.
struct Member {
  explicit Member(const AgentKeys& keys)
      : guard{{300, std::chrono::milliseconds{800}, 16}, keys, arena} {
    guard.set_wall_clock(kNow);
  }
  Arena arena{std::size_t{1} << 20};
  Guard guard;
};

AgentKeys keys_of(std::uint16_t agent, const SigningKey& operator_key, const GroupKey& group) {
  AgentKeys keys;
  keys.operator_key = verifying_key(operator_key);
  keys.agent = agent;
  keys.generation = 1;
  keys.validity = {kNow - 1000, kNow + 1000};
  fill_random(keys.own.bytes());
  keys.group = group;
  return keys;
}

/// Until each knows that the other is there. @return frames that took, and their bytes
std::pair<int, std::size_t> meet(Member& a, Member& b, std::span<const std::byte> word,
                                 Instant& now) {
  const auto hear = [&](Member& to, std::span<const std::byte> frame) {
    return !to.guard.open(frame, now).empty();
  };
  (void)hear(b, a.guard.seal(word));
  (void)hear(a, b.guard.seal(word));
  int frames = 0;
  std::size_t bytes = 0;
  for (int i = 0; i < 100; ++i, now += std::chrono::milliseconds{20}) {
    for (auto [from, to] : {std::pair{&a, &b}, std::pair{&b, &a}}) {
      const auto frame = from->guard.next(now);
      if (frame.empty()) continue;
      ++frames;
      bytes += frame.size();
      (void)hear(*to, frame);
    }
  }
  return {frames, bytes};
}

/// As many delta-poses as fit, or one.
std::vector<std::byte> filled(std::size_t room, bool one, int& records) {
  std::mt19937 dice{1};
  std::vector<std::byte> buffer(room);
  DatagramWriter out{buffer, {{1, 7}, 0}};
  RecordContext context{1, 7};
  for (records = 0; records < (one ? 1 : 1000); ++records) {
    const auto seq = static_cast<std::uint32_t>(records);
    const auto record = quantise(delta_pose(dice, seq), 1, 7, seq);
    std::array<std::byte, kMaxRecordBytes> body{};
    ByteWriter writer{body};
    RecordContext after = context;
    write_record(writer, after, *record);
    if (!out.add(EntryKind::kDeltaPose, std::span{body}.first(writer.size()))) break;
    context = after;
  }
  const auto bytes = out.finish();
  return {bytes.begin(), bytes.end()};
}

template <class Work>
double us_each(int count, Work&& work) {
  const auto start = std::chrono::steady_clock::now();
  for (int i = 0; i < count; ++i) work();
  return std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start)
             .count() /
         count;
}

}  // namespace

int main() {
  constexpr int kCount = 200000;
  SigningKey operator_key;
  fill_random(operator_key.bytes());
  GroupKey group;
  fill_random(group.bytes());
  Member a{keys_of(1, operator_key, group)};
  Member b{keys_of(2, operator_key, group)};
  Instant now{std::chrono::hours{1}};
  int any = 0;
  const auto [frames_of_meeting, bytes_of_meeting] = meet(a, b, filled(200, true, any), now);
  fmt::print("two agents meet: {} frames, {} bytes in all\n", frames_of_meeting, bytes_of_meeting);

  fmt::print("{:<26}{:>8}{:>8}{:>8}{:>11}{:>9}{:>9}{:>9}{:>9}\n", "datagram", "records", "plain",
             "sealed", "B/record", "seal us", "open us", "crc us", "mallocs");
  const struct {
    const char* name;
    std::size_t bytes;
    bool one;
  } kCases[] = {{"radio, full", radio_profile().datagram_bytes - kSealBytes, false},
                {"wifi, full", wifi_profile().datagram_bytes - kSealBytes, false},
                {"a lone record", 200, true}};
  for (const auto& one : kCases) {
    int records = 0;
    const auto plain = filled(one.bytes, one.one, records);
    const std::size_t sealed = a.guard.seal(plain).size();
    std::vector<std::vector<std::byte>> frames(kCount);
    for (auto& frame : frames) {
      const auto made = a.guard.seal(plain);
      frame.assign(made.begin(), made.end());
    }
    std::size_t at = 0;
    int good = 0;
    const std::uint64_t before = maplet::graphs::heap_allocations();
    const double seal_us = us_each(kCount, [&] { (void)a.guard.seal(plain); });
    const double open_us =
        us_each(kCount, [&] { good += b.guard.open(frames[at++], now).empty() ? 0 : 1; });
    const std::uint64_t mallocs = maplet::graphs::heap_allocations() - before;
    std::uint32_t sum = 0;
    const double crc_us = us_each(kCount, [&] { sum += crc32c(plain); });
    if (good != kCount || sum == 1) return 1;
    fmt::print("{:<26}{:>8}{:>8}{:>8}{:>11.2f}{:>9.2f}{:>9.2f}{:>9.2f}{:>9}\n", one.name, records,
               plain.size(), sealed, static_cast<double>(sealed - plain.size()) / records, seal_us,
               open_us, crc_us, mallocs);
  }
  KeyNotice notice;
  notice.team = team_of(verifying_key(operator_key));
  notice.generation = 2;
  notice.validity = {kNow, kNow + 1000};
  ExchangeKey passing;
  fill_random(passing.bytes());
  notice.passing = exchange_public(passing);
  for (std::uint16_t agent = 2; agent < 7; ++agent) {
    notice.sealed.push_back(
        seal_for(agent, exchange_public(b.guard.keys().own), passing, 2, group));
  }
  const auto bytes = to_bytes(notice, operator_key);
  fmt::print("a notice for 5 robots: {} bytes, taken in {:.0f} us\n", bytes.size(),
             us_each(1, [&] { (void)b.guard.take_notice(bytes, now); }));
  return b.guard.keys().generation == 2 ? 0 : 1;
}
