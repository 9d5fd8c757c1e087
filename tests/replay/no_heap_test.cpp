// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// A whole mission, with files and DDS, and not one heap allocation of ours after start.
#include <gtest/gtest.h>

#include "tests/support/run.hpp"
#include "tests/support/temp_dir.hpp"

namespace maplet::test {
namespace {

TEST(NoHeap, MissionWithDds) {
  const TempDir dir;
  const Finished mapped = run({"mapletd", "--source", "sim:loop?seed=3&frames=400&width=320",
                               "--out", (dir / "out").string(), "--set", "dds.domain=87"},
                              std::chrono::seconds{120});
  ASSERT_EQ(mapped.exit_code, 0) << mapped.err;
  const auto report = report_of(dir / "out");
  EXPECT_GE(report["maplets"]["count"], 3);
  EXPECT_GE(report["delta_poses"]["count"], 2);
  const auto& allocations = report["memory"]["heap_allocations_after_ready"];
  if (allocations.is_null()) GTEST_SKIP() << "SKIPPED: a sanitizer owns malloc";
  EXPECT_EQ(allocations, 0);
  EXPECT_GT(report["memory"]["arena_bytes"], 1 << 20);
}

}  // namespace
}  // namespace maplet::test
