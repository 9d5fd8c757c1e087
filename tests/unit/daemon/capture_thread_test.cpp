// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/capture_thread.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <thread>
#include <vector>

namespace maplet::daemon {
namespace {

using namespace std::chrono_literals;

/// Frames of one value each, as fast as they are asked for; then the end.
class Counting final : public DepthSource {
 public:
  explicit Counting(int frames, Duration pause = {}) : frames_{frames}, pause_{pause} {}
  Expected<DepthFrame> next(Deadline) noexcept override {
    if (static_cast<int>(counters_.read) == frames_) return fail(ErrorCode::kEnd, "over");
    std::this_thread::sleep_for(pause_);
    std::fill(pixels_.begin(), pixels_.end(), static_cast<std::uint16_t>(counters_.read + 1));
    DepthFrame frame;
    frame.index = counters_.read++;
    frame.stamp = std::chrono::milliseconds{10} * counters_.read;
    frame.depth = {pixels_.data() + 2, 4, 3, 6};  // rows are longer than the image is wide
    return frame;
  }
  SourceCounters counters() const noexcept override { return counters_; }
  std::optional<std::uint64_t> length() const noexcept override {
    return static_cast<std::uint64_t>(frames_);
  }

 private:
  int frames_;
  Duration pause_;
  std::vector<std::uint16_t> pixels_ = std::vector<std::uint16_t>(20);
  SourceCounters counters_;
};

/// What comes until the end; every pixel is the frame's own.
std::vector<std::uint64_t> drain(CaptureThread& capture, Duration work) {
  std::vector<std::uint64_t> indices;
  while (true) {
    const auto frame = capture.next(Deadline::never());
    if (!frame) {
      EXPECT_NE(frame.error().code, ErrorCode::kDevice);
      if (frame.error().code == ErrorCode::kEnd) return indices;
      continue;
    }
    std::this_thread::sleep_for(work);  // the source goes on meanwhile
    for (int v = 0; v < 3; ++v) {
      for (int u = 0; u < 4; ++u) EXPECT_EQ(frame->depth.at(u, v), frame->index + 1);
    }
    indices.push_back(frame->index);
  }
}

TEST(CaptureThread, GivesEveryFrameToWhoIsQuick) {
  FramePool pool{640 * 480};
  CaptureThread capture{std::make_unique<Counting>(20, 5ms), Pace::kLive, pool, [] {}};
  EXPECT_EQ(capture.length(), 20U);
  const auto indices = drain(capture, 0ms);
  EXPECT_EQ(indices.back(), 19U);
  EXPECT_EQ(indices.size() + capture.counters().dropped, 20U);
}

TEST(CaptureThread, TheNewestWinsAndTheOthersAreCounted) {
  FramePool pool{640 * 480};
  CaptureThread capture{std::make_unique<Counting>(60, 2ms), Pace::kLive, pool, [] {}};
  const auto indices = drain(capture, 20ms);
  EXPECT_EQ(indices.back(), 59U);
  EXPECT_LT(indices.size(), 30U);
  EXPECT_TRUE(std::is_sorted(indices.begin(), indices.end()));
  EXPECT_EQ(capture.counters().read, 60U);
  EXPECT_EQ(capture.counters().dropped, 60U - indices.size());
}

TEST(CaptureThread, RecordedPaceKeepsTheStamps) {
  FramePool pool{640 * 480};
  const auto begin = std::chrono::steady_clock::now();
  CaptureThread capture{std::make_unique<Counting>(21), Pace::kRecorded, pool, [] {}};
  drain(capture, 0ms);
  EXPECT_GE(std::chrono::steady_clock::now() - begin, 199ms);  // 20 x 10 ms
}

TEST(CaptureThread, EndsWhileTheSourceGoesOn) {
  FramePool pool{640 * 480};
  CaptureThread capture{std::make_unique<Counting>(1'000'000), Pace::kRecorded, pool, [] {}};
  EXPECT_TRUE(capture.next(Deadline::never()));
}

}  // namespace
}  // namespace maplet::daemon
