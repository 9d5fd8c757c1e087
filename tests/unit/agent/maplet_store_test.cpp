// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/agent/maplet_store.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace maplet {
namespace {

std::vector<std::byte> some_bytes(std::size_t count, int value) {
  return std::vector<std::byte>(count, std::byte(value));
}

TEST(MapletStore, KeepsTheNewestOnes) {
  Arena arena{1 << 20};
  MapletStore store{3, 100, arena};
  for (std::uint32_t id = 0; id < 5; ++id) store.put(id, some_bytes(10 + id, static_cast<int>(id)));
  EXPECT_FALSE(store.find(0));
  EXPECT_FALSE(store.find(1));
  EXPECT_FALSE(store.find(77));
  EXPECT_EQ(store.forgotten(), 2u);
  const auto newest = store.find(4);
  ASSERT_TRUE(newest);
  EXPECT_EQ(newest->size(), 14u);
  EXPECT_EQ((*newest)[13], std::byte{4});
}

TEST(MapletStoreDeathTest, TooLargeAMapletIsABug) {
  Arena arena{1 << 20};
  MapletStore store{3, 100, arena};
  EXPECT_DEATH(store.put(0, some_bytes(101, 1)), "");
}

}  // namespace
}  // namespace maplet
