// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/base/crc.hpp"

#include <gtest/gtest.h>

#include <array>
#include <string_view>

namespace maplet {
namespace {

TEST(Crc32c, MatchesPublishedValues) {
  EXPECT_EQ(crc32c(std::as_bytes(std::span{std::string_view{"123456789"}})), 0xE3069283U);
  std::array<std::byte, 32> zeros{};
  EXPECT_EQ(crc32c(zeros), 0x8A9136AAU);  // RFC 3720, B.4
  EXPECT_EQ(crc32c({}), 0U);
}

TEST(Crc32c, GoesOnWhereItStopped) {
  const auto all = std::as_bytes(std::span{std::string_view{"123456789"}});
  EXPECT_EQ(crc32c(all.subspan(4), crc32c(all.first(4))), crc32c(all));
}

}  // namespace
}  // namespace maplet
