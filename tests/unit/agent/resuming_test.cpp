// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// An agent that is given what an earlier run left.
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "core/agent/agent.hpp"
#include "core/agent/own_places.hpp"
#include "core/maplet/codec.hpp"
#include "tests/support/maplets.hpp"

namespace maplet::test {
namespace {

struct NoMeter final : StageMeter {
  void begin(Stage) noexcept override {}
  void end(Stage, Duration) noexcept override {}
};

struct NoRecords final : RecordSink {
  std::optional<DeltaPose> put(const DeltaPose& delta) noexcept override { return delta; }
  std::optional<MapletRange> put(const MapletRange& range) noexcept override { return range; }
};

constexpr AgentIdentity kSelf{1, 7};

MapletKey own(std::uint32_t id) { return {kSelf.agent, kSelf.epoch, id}; }

std::vector<std::byte> maplet_of_a_room(std::uint32_t id) {
  const auto maplet = std::make_unique<Maplet>();
  fill(*maplet, room(), camera_at({1.0 + 0.5 * id, 2.5, 1.2}, 0.3 * id));
  maplet->key = own(id);
  std::vector<std::byte> bytes(kMaxMapletBytes);
  const auto size = encode(*maplet, bytes);
  EXPECT_TRUE(size);
  bytes.resize(*size);
  return bytes;
}

class Resuming : public testing::Test {
 protected:
  Arena arena_;
  NoMeter meter_;
  NoRecords records_;
  Agent agent_{AgentConfig{}, kSelf, meter_, records_, arena_};
};

TEST_F(Resuming, WhatMakesNoSenseIsNotTakenIn) {
  std::vector<std::byte> bytes = maplet_of_a_room(0);
  EXPECT_FALSE(agent_.restore(own(1), bytes));  // another one's name
  bytes[bytes.size() / 2] ^= std::byte{1};
  EXPECT_FALSE(agent_.restore(own(0), bytes));
  EXPECT_FALSE(agent_.restore(own(0), {}));
  EXPECT_EQ(agent_.maplets().count(), 0U);
  EXPECT_TRUE(agent_.restore(own(0), maplet_of_a_room(0)));
  EXPECT_FALSE(agent_.restore(own(0), maplet_of_a_room(0)));  // twice
}

TEST_F(Resuming, OldMapletsAreReadOneByOneBesideTheFrames) {
  constexpr std::uint32_t kOld = 5;
  for (std::uint32_t i = 0; i < kOld; ++i) EXPECT_TRUE(agent_.restore(own(i), maplet_of_a_room(i)));
  EXPECT_FALSE(agent_.encounters().busy());
  agent_.begin_part(kOld);
  for (std::uint32_t i = 0; i < kOld; ++i) EXPECT_EQ(agent_.meet(Deadline::never()), i + 1 < kOld);
  EXPECT_FALSE(agent_.encounters().busy());
  EXPECT_EQ(agent_.skeleton().node_count(), static_cast<int>(kOld));
  EXPECT_EQ(agent_.maplets().count(), kOld);
}

TEST_F(Resuming, AFrontierIsLookedForWhenAMapletIsFirstLoaded) {
  MapletStore store{4, 4096, kMaxMapletBytes, arena_};
  ASSERT_TRUE(store.put(own(0), maplet_of_a_room(0)));
  Arena arena;
  Skeleton skeleton{{}, arena};
  skeleton.add(own(0));
  const auto scratch = std::make_unique<Maplet>();
  const MapletViews views{store, arena};
  OwnPlaces places{skeleton, views, store, *scratch};
  EXPECT_EQ(places.frontier(0), nullptr);
  EXPECT_FALSE(store.knows_frontier(own(0)));
  ASSERT_NE(places.load(0), nullptr);
  ASSERT_TRUE(store.knows_frontier(own(0)));
  const Frontier expected = find_frontier(*scratch, up_of(*scratch));
  const RegionOfInterest* found = places.frontier(0);
  ASSERT_EQ(found != nullptr, expected.cells > 0);
  for (std::size_t i = 0; found != nullptr && i < expected.region.corners.size(); ++i)
    EXPECT_EQ(found->corners[i], expected.region.corners[i]);
}

}  // namespace
}  // namespace maplet::test
