// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/dds/handshake_pace.hpp"

#include <gtest/gtest.h>

#include <string_view>
#include <vector>

namespace maplet {
namespace {

using namespace std::chrono_literals;

std::vector<std::byte> from_hex(std::string_view hex) {
  std::vector<std::byte> bytes;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2) {
    bytes.push_back(static_cast<std::byte>(std::stoi(std::string{hex.substr(i, 2)}, nullptr, 16)));
  }
  return bytes;
}

// The beginnings of what Cyclone DDS 0.10.2 sends: to 82e88fc75c2b0d981578a40b.
constexpr std::string_view kRequest =
    "5254505302010110808939d79de9744cc8f29cec0e010c0082e88fc75c2b0d981578a40b"
    "090108005d13096b30ed6f831601200500001c00000201c4000201c30000000002000000";
constexpr std::string_view kLastFragment =
    "5254505302010110808939d79de9744cc8f29cec0e010c0082e88fc75c2b0d981578a40b"
    "13011800000201c4000201c300000000020000000200000002000000160170040000";
constexpr std::string_view kAnnouncement =
    "5254505302010110808939d79de9744cc8f29cec0e010c0082e88fc75c2b0d981578a40b"
    "090108005d13096b30ed6f831505000000001000000100c7000100c20000000001000000";

TEST(HandshakePace, KnowsIntroductionsAndWhomTheyAreFor) {
  GuidPrefix wanted{};
  std::ranges::copy(from_hex("82e88fc75c2b0d981578a40b"), wanted.begin());
  EXPECT_EQ(introduced_to(from_hex(kRequest)), wanted);
  EXPECT_EQ(introduced_to(from_hex(kLastFragment)), wanted);
  EXPECT_FALSE(introduced_to(from_hex(kAnnouncement)));
  std::vector<std::byte> other = from_hex(kRequest);
  other[0] = std::byte{'Q'};
  EXPECT_FALSE(introduced_to(other));
  const auto whole = from_hex(kRequest);
  for (std::size_t size = 0; size < 64; ++size) {
    EXPECT_FALSE(introduced_to(std::span{whole}.first(size))) << size;
  }
}

/// Introductions in each ten seconds, where DDS tries every second.
std::vector<int> in_ten_seconds(HandshakePace& pace, const GuidPrefix& to, int tens) {
  std::vector<int> passed;
  for (int i = 0; i < 10 * tens; ++i) {
    if (i % 10 == 0) passed.push_back(0);
    const Instant now{std::chrono::seconds{100 + i}};
    const bool may = pace.allows(to, now);
    EXPECT_EQ(pace.allows(to, now + 50ms), may);  // its second fragment
    passed.back() += may ? 1 : 0;
  }
  return passed;
}

TEST(HandshakePace, BecomesSeldomForWhoeverDoesNotAnswer) {
  HandshakePace pace;
  const auto passed = in_ten_seconds(pace, {std::byte{1}}, 20);
  EXPECT_GE(passed[0], HandshakePace::kFree + 1);
  EXPECT_LE(passed[0], HandshakePace::kFree + 2);
  for (std::size_t i = 3; i < passed.size(); ++i) {
    EXPECT_LE(passed[i], 1);
    EXPECT_GE(passed[i] + passed[i - 1], 1);  // and never ends
  }
  // Somebody else does not wait for it.
  EXPECT_EQ(in_ten_seconds(pace, {std::byte{2}}, 1)[0], passed[0]);
}

TEST(HandshakePace, RemembersTheLatest) {
  HandshakePace pace;
  const auto number = [](std::size_t i) {
    return GuidPrefix{std::byte{7}, static_cast<std::byte>(i), static_cast<std::byte>(i >> 8)};
  };
  for (std::size_t i = 0; i < 10 * HandshakePace::kMost; ++i) {
    EXPECT_TRUE(pace.allows(number(i), Instant{10s + i * 1ms}));
  }
}

}  // namespace
}  // namespace maplet
