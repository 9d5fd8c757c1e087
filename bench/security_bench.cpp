// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// What security costs a datagram and a record: bytes, microseconds, allocations.
#include <fmt/core.h>

#include <chrono>
#include <random>
#include <vector>

#include "core/base/crc.hpp"
#include "tests/support/records.hpp"
#include "tests/support/team.hpp"
#include "tools/solve/heap_count.hpp"
#include "transport/exchange/record_codec.hpp"
#include "transport/sync/sync_config.hpp"

namespace {

using namespace maplet;

/// As many delta-poses as fit, or one.
std::vector<std::byte> filled(std::size_t room, bool one, int& records) {
  std::mt19937 dice{1};
  std::vector<std::byte> buffer(room);
  DatagramWriter out{buffer, {{1, 7}, 0}};
  RecordContext context{1, 7};
  for (records = 0; records < (one ? 1 : 1000); ++records) {
    const auto seq = static_cast<std::uint32_t>(records);
    const auto record = quantise(test::random_delta(dice, 1, 7, seq), 1, 7, seq);
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
  test::Team team;
  test::Member a{team.keys(1)};
  test::Member b{team.keys(2)};
  Instant now{std::chrono::hours{1}};
  (void)hear(b, test::copy(a.guard.seal(test::datagram(1, "x"))), now);
  (void)hear(a, test::copy(b.guard.seal(test::datagram(2, "x"))), now);
  talk({&a, &b}, now, std::chrono::seconds{2});

  fmt::print("{:<26}{:>8}{:>8}{:>8}{:>11}{:>9}{:>9}{:>9}{:>7}\n", "datagram", "records", "plain",
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
    for (auto& frame : frames) frame = test::copy(a.guard.seal(plain));
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
    fmt::print("{:<26}{:>8}{:>8}{:>8}{:>11.2f}{:>9.2f}{:>9.2f}{:>9.2f}{:>7}\n", one.name, records,
               plain.size(), sealed, static_cast<double>(sealed - plain.size()) / records, seal_us,
               open_us, crc_us, mallocs);
  }
  const auto notice = team.rotate({}).front();
  fmt::print("notice for 2 robots {} bytes, for 18 at most {}; taken in {:.0f} us\n", notice.size(),
             kMaxNoticeBytes, us_each(1, [&] { (void)b.guard.take_notice(notice, now); }));
  return 0;
}
