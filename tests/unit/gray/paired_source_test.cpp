// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/paired_source.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <functional>
#include <random>
#include <thread>

#include "drivers/gray_ring.hpp"

namespace maplet {
namespace {

using namespace std::chrono_literals;

Instant at(double ms) { return Instant{Duration{std::llround(ms * 1e6)}}; }

void put(GrayRing& ring, Instant stamp, std::uint8_t value) {
  std::fill(ring.room().begin(), ring.room().end(), value);
  ring.put(stamp);
}

TEST(GrayRing, GivesTheNearest) {
  GrayRing ring{4};
  std::array<std::uint8_t, 4> out{};
  EXPECT_FALSE(ring.nearest(at(0), 20ms, 0ms, out));
  for (int i = 1; i <= 6; ++i) put(ring, at(33.0 * i), static_cast<std::uint8_t>(i));
  EXPECT_EQ(ring.nearest(at(33 * 4 + 10), 20ms, 0ms, out), at(33 * 4));
  EXPECT_EQ(out[3], 4);
  EXPECT_EQ(ring.nearest(at(33 * 5 - 10), 20ms, 0ms, out), at(33 * 5));
  EXPECT_FALSE(ring.nearest(at(33 * 1), 20ms, 0ms, out)) << "gone: four are kept";
  EXPECT_EQ(ring.nearest(at(33 * 6 + 20), 20ms, 0ms, out), at(33 * 6));
  EXPECT_FALSE(ring.nearest(at(33 * 6 + 20.001), 20ms, 0ms, out));
  EXPECT_EQ(ring.images(), 6u);
  ring.clear();
  EXPECT_FALSE(ring.nearest(at(33 * 5), 20ms, 0ms, out));
}

TEST(GrayRing, OfTwoEquallyNearGivesTheEarlier) {
  GrayRing ring{1};
  std::array<std::uint8_t, 1> out{};
  put(ring, at(100), 1);
  put(ring, at(120), 2);
  EXPECT_EQ(ring.nearest(at(110), 20ms, 0ms, out), at(100));
}

TEST(GrayRing, WaitsForALaterImage) {
  GrayRing ring{1};
  std::array<std::uint8_t, 1> out{};
  put(ring, at(100), 1);
  std::thread camera{[&] {
    std::this_thread::sleep_for(20ms);
    put(ring, at(131), 2);
  }};
  EXPECT_EQ(ring.nearest(at(130), 50ms, 2s, out), at(131));
  camera.join();
  EXPECT_EQ(out[0], 2);
}

// A device 100 ppm off, 3 ms to 25 ms on the way: the clocks are matched to the quickest way.
TEST(StampClock, FindsTheQuickestWayAndFollowsDrift) {
  StampClock clock;
  std::mt19937 random{5};
  std::exponential_distribution<double> late_ms{1.0 / 4.0};
  double worst_ms = 0.0;
  for (int i = 0; i < 3000; ++i) {
    const double made_ms = 1e6 + i * 33.333;
    const double way_ms = 3.0 + std::min(22.0, late_ms(random));
    const Stamp stamp{std::llround((made_ms - 1e6) * (1.0 + 100e-6) * 1e6)};
    const double found_ms =
        seconds(clock.at(stamp, at(made_ms + way_ms)).time_since_epoch()) * 1e3 - made_ms;
    if (i > 300) worst_ms = std::max(worst_ms, std::abs(found_ms - 3.0));
  }
  EXPECT_LT(worst_ms, 1.1);  // 100 ppm of two spans, and what is left of the quickest way
}

TEST(StampClock, BeginsAnewWithTheDevice) {
  StampClock clock;
  EXPECT_EQ(clock.at(1000ms, at(5000)), at(5000));
  EXPECT_EQ(clock.at(1033ms, at(5040)), at(5033));
  EXPECT_EQ(clock.at(0ms, at(9000)), at(9000));  // it was opened again
}

/// Stamps of its own, depth of one pixel.
class Depth final : public DepthSource {
 public:
  Expected<DepthFrame> next(Deadline) noexcept override {
    DepthFrame frame;
    frame.index = count_;
    frame.stamp = 33ms * ++count_;
    frame.gray = {reinterpret_cast<const std::uint8_t*>(&pixel_), 1, 1, 1};
    came_ = Instant{1h + frame.stamp + 4ms};
    return frame;
  }
  SourceCounters counters() const noexcept override { return {}; }
  std::optional<Instant> came() const noexcept override { return came_; }

 private:
  std::uint16_t pixel_ = 7;
  int count_ = 0;
  std::optional<Instant> came_;
};

/// A gray camera whose images are made by hand.
class Gray final : public GrayCamera {
 public:
  std::optional<Instant> nearest(Instant at, Duration tolerance, Duration,
                                 std::span<std::uint8_t> to) noexcept override {
    return ring.nearest(at, tolerance, 0ms, to);
  }
  bool running() const noexcept override { return on; }
  std::uint64_t images() const noexcept override { return ring.images(); }
  Line state() const noexcept override { return {}; }

  GrayRing ring{2};
  bool on = true;
};

TEST(PairedSource, GivesEachDepthFrameItsImage) {
  GrayCameraOptions options;
  options.camera = {2, 1, 10.0, 10.0, 0.5, 0.0};
  options.T_depth_gray.t = {0.025, 0.0, 0.0};
  options.depth_delay = 4ms;
  Gray gray;
  PairedSource source{std::make_unique<Depth>(), gray, options};
  for (int i = 1; i <= 3; ++i)
    put(gray.ring, Instant{1h + 33ms * i + 6ms}, static_cast<std::uint8_t>(40 + i));
  for (int i = 1; i <= 3; ++i) {
    const auto frame = source.next(Deadline::never());
    ASSERT_TRUE(frame);
    EXPECT_TRUE(frame->gray.empty()) << "the depth camera's own is not used";
    ASSERT_FALSE(frame->gray_beside.pixels.empty());
    EXPECT_EQ(frame->gray_beside.pixels.at(1, 0), 40 + i);
    EXPECT_EQ(frame->gray_beside.camera.width_px, 2);
    EXPECT_EQ(frame->gray_beside.T_depth_gray.t.x(), 0.025);
  }
  const auto without = source.next(Deadline::never());  // 27 ms from the last image
  ASSERT_TRUE(without);
  EXPECT_TRUE(without->gray_beside.pixels.empty());
  EXPECT_EQ(gray.paired, 3u);
  EXPECT_EQ(gray.alone, 1u);
  gray.on = false;
  EXPECT_TRUE(source.next(Deadline::never())->gray_beside.pixels.empty());
  EXPECT_EQ(gray.alone, 2u);
}

}  // namespace
}  // namespace maplet
