// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/base/arena.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>

#include "core/base/arena_exhausted.hpp"

namespace maplet {
namespace {

TEST(Arena, KeepsALedgerOfWhatItHandsOut) {
  Arena arena{1 << 20};
  const auto bytes = arena.make_array<char>(3, "test/bytes");
  const auto numbers = arena.make_array<double>(10, "test/numbers");
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(numbers.data()) % alignof(double), 0u);
  EXPECT_EQ(numbers[9], 0.0);
  EXPECT_EQ(bytes.size(), 3u);
  ASSERT_EQ(arena.ledger().size(), 2u);
  EXPECT_EQ(arena.ledger()[1].component, "test/numbers");
  EXPECT_EQ(arena.ledger()[1].bytes, 80u);
  EXPECT_EQ(arena.used_bytes(), 88u);
}

TEST(ArenaDeathTest, TerminatesWhenExhausted) {
  Arena arena{4096};
  try {
    (void)arena.make_array<char>(5000, "test/too-much");
    FAIL() << "more than was reserved";
  } catch (const ArenaExhausted& e) {
    EXPECT_NE(std::string{e.what()}.find("test/too-much"), std::string::npos) << e.what();
  }
}

TEST(ArenaDeathTest, TerminatesAfterTheSeal) {
  Arena arena{4096};
  (void)arena.seal(false);
  EXPECT_DEATH((void)arena.make_array<char>(1, "test/late"), "after start-up");
}

}  // namespace
}  // namespace maplet
