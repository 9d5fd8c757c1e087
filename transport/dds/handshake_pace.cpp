// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/dds/handshake_pace.hpp"

#include <algorithm>

namespace maplet {

namespace {

using namespace std::chrono_literals;

constexpr Duration kTogether = 500ms;  // the fragments of one
constexpr Duration kAgain = 1s;        // Cyclone's, fixed
constexpr std::array kMagic{std::byte{'R'}, std::byte{'T'}, std::byte{'P'}, std::byte{'S'}};
constexpr std::array kStatelessWriter{std::byte{0x00}, std::byte{0x02}, std::byte{0x01},
                                      std::byte{0xc3}};

// RTPS 2.3, 9.4.5.
constexpr std::size_t kHeaderBytes = 20;
constexpr std::size_t kSubmessageHeaderBytes = 4;
constexpr unsigned kInfoDestination = 0x0e;
constexpr unsigned kHeartbeatFrag = 0x13;
constexpr unsigned kData = 0x15;
constexpr unsigned kDataFrag = 0x16;

}  // namespace

std::optional<GuidPrefix> introduced_to(std::span<const std::byte> head) noexcept {
  if (head.size() < kHeaderBytes || !std::ranges::equal(head.first(kMagic.size()), kMagic)) {
    return {};
  }
  GuidPrefix prefix{};
  std::size_t at = kHeaderBytes;
  while (at + kSubmessageHeaderBytes <= head.size()) {
    const auto kind = std::to_integer<unsigned>(head[at]);
    const bool little = (head[at + 1] & std::byte{1}) != std::byte{};
    const auto low = std::to_integer<std::size_t>(head[at + (little ? 2 : 3)]);
    const auto high = std::to_integer<std::size_t>(head[at + (little ? 3 : 2)]);
    const auto body = head.subspan(at + kSubmessageHeaderBytes);
    if (kind == kInfoDestination && body.size() >= prefix.size()) {
      std::ranges::copy(body.first(prefix.size()), prefix.begin());
    } else if (kind == kData || kind == kDataFrag || kind == kHeartbeatFrag) {
      const std::size_t writer = kind == kHeartbeatFrag ? 4 : 8;
      const bool introduces =
          body.size() >= writer + kStatelessWriter.size() &&
          std::ranges::equal(body.subspan(writer, kStatelessWriter.size()), kStatelessWriter);
      return introduces ? std::optional{prefix} : std::nullopt;
    }
    at += kSubmessageHeaderBytes + (high << 8 | low);
  }
  return {};
}

HandshakePace::Stranger& HandshakePace::find_or_add(const GuidPrefix& prefix) noexcept {
  const auto known = std::ranges::find_if(
      strangers_, [&](const Stranger& one) { return one.times > 0 && one.prefix == prefix; });
  if (known != strangers_.end()) return *known;
  Stranger& place = *std::ranges::min_element(strangers_, {}, &Stranger::last);
  place = {prefix, 0, {}, {}};
  return place;
}

bool HandshakePace::allows(const GuidPrefix& to, Instant now) noexcept {
  Stranger& stranger = find_or_add(to);
  if (stranger.times > 0 && now - stranger.last < kTogether) return true;
  if (now < stranger.next) return false;
  ++stranger.times;
  stranger.last = now;
  // A little less: Cyclone's own second is not always quite one.
  const int doublings = std::clamp(stranger.times - kFree, 0, 8);
  const Duration pause =
      stranger.times < kFree ? Duration{} : std::min(kAgain * (2 << doublings), kMostPause);
  stranger.next = now + pause - kTogether;
  return true;
}

}  // namespace maplet
