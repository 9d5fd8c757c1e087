// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <array>
#include <vector>

#include "core/base/crc.hpp"
#include "daemon/flight_log.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace {

using namespace maplet;

/// The input as blocks with right heads: type, length (two octets), content; again and again.
std::vector<std::uint8_t> framed(const std::uint8_t* data, std::size_t size) {
  std::vector<std::uint8_t> file;
  std::uint32_t number = 0;
  const auto block = [&](flight::Block type, std::span<const std::byte> content) {
    std::array<std::uint32_t, 6> head{0x746C666D,
                                      number++,
                                      static_cast<std::uint32_t>(content.size()),
                                      crc32c(content),
                                      static_cast<std::uint32_t>(type),
                                      0};
    head[5] = crc32c(std::as_bytes(std::span{head}).first(20));
    const auto add = [&](std::span<const std::byte> bytes) {
      for (const std::byte b : bytes) file.push_back(std::to_integer<std::uint8_t>(b));
    };
    add(std::as_bytes(std::span{head}));
    add(content);
    file.resize((file.size() + flight::kAlign - 1) / flight::kAlign * flight::kAlign);
  };
  block(flight::Block::kHead, {});
  while (size >= 3) {
    const auto type = static_cast<flight::Block>(1 + data[0] % 3);
    const std::size_t bytes = std::min<std::size_t>(data[1] | data[2] << 8, size - 3);
    block(type, fuzz::bytes(data + 3, bytes));
    data += 3 + bytes;
    size -= 3 + bytes;
  }
  return file;
}

/// Asks as the daemon does, for whatever comes, and for things that do not.
void replay(std::unique_ptr<flight::RingReader> reader) {
  daemon::FlightLog log;
  log.replay(std::move(reader), {320, 240});
  std::vector<std::byte> bytes(kMaxMapletBytes);
  DeltaPoseRecord delta;
  RangeRecord range;
  RangeReport report;
  MapletKey key;
  MapletKey other;
  bool accept = false;
  SourceCounters counters;
  std::array<std::uint32_t, kStreams> ends{};
  while (!log.over()) {
    log.keep_going();
    (void)log.now();
    (void)log.budget({});
    (void)log.flag(true);
    (void)log.offset({});
    if (log.replayed(delta)) fuzz::require(valid(delta), "only sound delta-poses are replayed");
    if (log.replayed(range)) fuzz::require(valid(range), "only sound ranges are replayed");
    (void)log.replayed(report);
    fuzz::require(log.replayed_maplet(key, bytes) <= bytes.size(), "a maplet stays in its buffer");
    (void)log.replayed_decision(key, other, accept);
    (void)log.replayed_restored(ends);
    (void)log.take(flight::Event::kMark);
    const auto frame =
        log.frame([]() -> Expected<DepthFrame> { return fail(ErrorCode::kEnd, ""); });
    if (!frame) continue;
    unsigned sum = 0;
    for (int v = 0; v < frame->depth.height_px; ++v)
      for (int u = 0; u < frame->depth.width_px; ++u) sum += frame->depth.row(v)[u];
    for (const auto& gray : {frame->gray, frame->gray_beside.pixels}) {
      for (int v = 0; !gray.empty() && v < gray.height_px; ++v)
        sum += gray.row(v)[gray.width_px - 1];
    }
    [[maybe_unused]] static volatile unsigned seen;
    seen = sum;  // a sanitizer sees pixels that are not there
  }
  log.replayed_stop(counters);
}

}  // namespace

// A flight recorder's file of any bytes: the first octet 0 plays them as they are; else they are
// the contents of blocks with right heads and checksums.
int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  std::vector<std::uint8_t> file{data + 1, data + size};
  if (data[0] != 0) file = framed(data + 1, size - 1);
  if (file.empty()) return 0;  // fmemopen wants something
  flight::File stream{fmemopen(file.data(), file.size(), "rb")};
  auto reader = flight::RingReader::read(std::move(stream), "a file");
  if (!reader) {
    fuzz::require_one_line(reader.error());
    return 0;
  }
  replay(std::move(*reader));
  return 0;
}
