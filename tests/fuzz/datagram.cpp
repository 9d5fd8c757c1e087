// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <memory>
#include <vector>

#include "core/base/crc.hpp"
#include "tests/fuzz/fuzz.hpp"
#include "transport/sync/node.hpp"

namespace {

using namespace maplet;

struct Taker final : RecordTaker {
  bool take(const DeltaPoseRecord& record) noexcept override {
    fuzz::require(valid(record), "only sound delta-poses are taken");
    return true;
  }
  bool take(const RangeRecord& record) noexcept override {
    fuzz::require(valid(record), "only sound ranges are taken");
    return true;
  }
  bool take(const MapletKey&, std::span<const std::byte> bytes) noexcept override {
    fuzz::require(bytes.size() <= 4096, "only maplets that fit are taken");
    return true;
  }
  float wish(const MapletKey&, float saliency) noexcept override { return saliency; }
};

}  // namespace

// Datagrams from anybody, one after the other: a length in two octets, then so many bytes. As they
// came, and with the checksum mended; the node's answers go to a second node.
int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const SyncConfig config{.max_lives = 8, .records_kept = 64, .ranges_kept = 16, .maplets_kept = 8};
  Arena arena{std::size_t{1} << 24};
  Taker taker;
  const auto a =
      std::make_unique<ExchangeNode>(config, wifi_profile(), 4096, Life{1, 1}, taker, arena);
  const auto b =
      std::make_unique<ExchangeNode>(config, radio_profile(), 4096, Life{2, 2}, taker, arena);
  Instant now{std::chrono::hours{1}};
  for (std::size_t at = 0; at + 2 <= size;) {
    const std::size_t length =
        std::min<std::size_t>(data[at] | std::size_t{data[at + 1]} << 8, size - at - 2);
    const auto input = fuzz::bytes(data + at + 2, length);
    std::vector<std::byte> bytes{input.begin(), input.end()};
    at += 2 + length;
    a->receive(bytes, now);
    if (length > kDatagramCrcBytes) {
      const std::uint32_t crc = crc32c(std::span{bytes}.first(length - kDatagramCrcBytes));
      for (std::size_t i = 0; i < 4; ++i) {
        bytes[length - 4 + i] = static_cast<std::byte>(crc >> 8 * i);
      }
      a->receive(bytes, now);
    }
    now += std::chrono::milliseconds{300};
    for (int i = 0; i < 8; ++i) {
      const auto out = a->next(now);
      if (out.bytes.empty()) break;
      b->receive(out.bytes, now);
    }
  }
  return 0;
}
