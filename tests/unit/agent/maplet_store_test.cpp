// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/agent/maplet_store.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace maplet {
namespace {

std::vector<std::byte> some_bytes(std::size_t count, int value) {
  return std::vector<std::byte>(count, std::byte(value));
}

MapletKey own(std::uint32_t id) { return {1, 1, id}; }

class Store : public testing::Test {
 protected:
  Arena arena_{1 << 20};
  MapletStore store_{3, 100, 100, arena_};

  bool put(const MapletKey& key, const std::vector<std::byte>& bytes) {
    return store_.put(key, bytes);
  }
};

TEST_F(Store, KeepsTheNewestOnes) {
  for (std::uint32_t id = 0; id < 5; ++id) {
    EXPECT_TRUE(put(own(id), some_bytes(10 + id, static_cast<int>(id))));
  }
  EXPECT_FALSE(store_.find(own(0)));
  EXPECT_FALSE(store_.find(own(1)));
  EXPECT_FALSE(store_.find(own(77)));
  EXPECT_EQ(store_.forgotten(), 2u);
  const auto newest = store_.find(own(4));
  ASSERT_TRUE(newest);
  EXPECT_EQ(newest->size(), 14u);
  EXPECT_EQ((*newest)[13], std::byte{4});
}

TEST_F(Store, TakesEachOnceAndNoneTooLarge) {
  EXPECT_FALSE(put(own(0), some_bytes(101, 1)));
  EXPECT_FALSE(put(own(0), {}));
  EXPECT_TRUE(put(own(0), some_bytes(9, 1)));
  EXPECT_FALSE(put(own(0), some_bytes(10, 2)));
  EXPECT_EQ(store_.find(own(0))->size(), 9u);
  EXPECT_EQ(store_.count(), 1u);
}

// Long ones take the room of several: whatever is still found is what was put, newest first.
TEST(StoreOfUnequalMaplets, KeepsTheNewestThatFit) {
  Arena arena{1 << 20};
  MapletStore store{8, 4096, 9000, arena};  // 32 KiB
  std::uint32_t random = 7;
  std::vector<std::size_t> sizes;
  for (std::uint32_t id = 0; id < 500; ++id) {
    random = random * 1664525u + 1013904223u;
    sizes.push_back(1 + (random >> 8) % 9000);
    ASSERT_TRUE(store.put(own(id), some_bytes(sizes.back(), static_cast<int>(id % 251))));
    std::size_t kept = 0;
    std::size_t bytes = 0;
    for (; kept <= id; ++kept) {
      const std::uint32_t other = id - static_cast<std::uint32_t>(kept);
      const auto found = store.find(own(other));
      if (!found) break;
      ASSERT_EQ(found->size(), sizes[other]);
      for (const std::byte byte : *found) ASSERT_EQ(byte, std::byte(other % 251));
      bytes += found->size();
    }
    EXPECT_EQ(store.forgotten(), id + 1 - kept);
    if (kept < std::min<std::size_t>(8, id + 1)) {  // at most one's length at either end is lost
      EXPECT_GT(bytes, 32768u - 2 * 9000u) << id;
    }
  }
}

TEST_F(Store, AgentsDoNotHideEachOther) {
  EXPECT_TRUE(put({2, 1, 7}, some_bytes(7, 2)));
  EXPECT_TRUE(put({3, 1, 7}, some_bytes(8, 3)));
  EXPECT_TRUE(put({2, 9, 7}, some_bytes(9, 4)));
  EXPECT_EQ(store_.find({2, 1, 7})->size(), 7u);
  EXPECT_EQ(store_.find({3, 1, 7})->size(), 8u);
  EXPECT_EQ(store_.find({2, 9, 7})->size(), 9u);
}

TEST_F(Store, RemembersFrontiersOfWhatItKeeps) {
  RegionOfInterest region;
  for (const auto& [x, z] : {std::pair{0.0, 0.0}, {1.0, 0.0}, {0.0, 1.0}}) {
    region.corners.push_back({x, z});
  }
  EXPECT_TRUE(put(own(0), some_bytes(10, 1)));
  EXPECT_EQ(store_.frontier(own(0)), nullptr);
  EXPECT_FALSE(store_.knows_frontier(own(0)));
  store_.set_frontier(own(0), region);
  store_.set_frontier(own(1), region);
  ASSERT_NE(store_.frontier(own(0)), nullptr);
  EXPECT_EQ(store_.frontier(own(0))->corners.size(), 3U);
  EXPECT_EQ(store_.frontier(own(1)), nullptr);
  store_.set_frontier(own(0), {});  // looked for, and there is none
  EXPECT_TRUE(store_.knows_frontier(own(0)));
  EXPECT_EQ(store_.frontier(own(0)), nullptr);
  for (std::uint32_t id = 1; id < 4; ++id) EXPECT_TRUE(put(own(id), some_bytes(10, 1)));
  EXPECT_EQ(store_.frontier(own(0)), nullptr);
}

}  // namespace
}  // namespace maplet
