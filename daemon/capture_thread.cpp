// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/capture_thread.hpp"

#include <algorithm>
#include <ctime>
#include <utility>

#include "daemon/alloc_counter.hpp"
#include "daemon/thread_setup.hpp"

namespace maplet::daemon {

namespace {

constexpr Duration kPatience = std::chrono::milliseconds{200};  // how often a stop is noticed

Duration now_of(clockid_t clock) noexcept {
  timespec time{};
  clock_gettime(clock, &time);
  return std::chrono::seconds{time.tv_sec} + Duration{time.tv_nsec};
}

template <class Pixel>
bool copy(ImageView<Pixel>& image, Pixel* to, std::size_t most) noexcept {
  if (image.empty()) return true;
  const auto width = static_cast<std::size_t>(image.width_px);
  const auto height = static_cast<std::size_t>(image.height_px);
  if (width * height > most) return false;
  for (std::size_t v = 0; v < height; ++v) {
    std::copy_n(image.row(static_cast<int>(v)), width, to + v * width);
  }
  image = {to, image.width_px, image.height_px, image.width_px};
  return true;
}

}  // namespace

FramePool::FramePool(std::size_t pixels) : pixels_{pixels} {
  for (Slot& slot : slots_) {
    slot.depth = std::make_unique_for_overwrite<std::uint16_t[]>(pixels);
    slot.gray = std::make_unique_for_overwrite<std::uint8_t[]>(pixels);
  }
}

CaptureThread::CaptureThread(std::unique_ptr<DepthSource> source, Pace pace, FramePool& pool,
                             const std::function<void()>& enter)
    : source_{std::move(source)}, pool_{pool}, pacer_{pace}, length_{source_->length()} {
  thread_ = start_thread("capture", [this, enter] {
    enter();
    watch_this_thread();
    loop();
  });
}

CaptureThread::~CaptureThread() {
  stop_ = true;
  thread_.join();
}

void CaptureThread::loop() noexcept {
  const MonotonicClock clock;
  while (!stop_) {
    const Duration wall = now_of(CLOCK_MONOTONIC);
    const Duration cpu = now_of(CLOCK_THREAD_CPUTIME_ID);
    const auto next = [&] {
      const ThirdPartyScope theirs;  // a camera's library, a recording's decoder
      return source_->next(Deadline{clock, kPatience});
    }();
    if (next) {
      const ReadCost cost{now_of(CLOCK_MONOTONIC) - wall, now_of(CLOCK_THREAD_CPUTIME_ID) - cpu,
                          source_->came()};
      pacer_.wait(next->stamp, stop_);
      if (!held_ && fill(*next)) offer(cost);
    } else if (next.error().code != ErrorCode::kTimeout) {
      const std::scoped_lock lock{mutex_};
      note();
      failure_ = next.error();
      changed_.notify_one();
      return;
    }
    const std::scoped_lock lock{mutex_};
    note();
  }
}

bool CaptureThread::fill(const DepthFrame& frame) noexcept {
  FramePool::Slot& slot = pool_.slot(filling_);
  slot.frame = frame;
  ImageView<std::uint8_t>& gray =
      frame.gray.empty() ? slot.frame.gray_beside.pixels : slot.frame.gray;
  return copy(slot.frame.depth, slot.depth.get(), pool_.pixels()) &&
         copy(gray, slot.gray.get(), pool_.pixels());
}

void CaptureThread::offer(ReadCost cost) noexcept {
  const std::scoped_lock lock{mutex_};
  if (held_) return;
  std::swap(filling_, newest_);
  if (fresh_) ++overrun_;
  fresh_ = true;
  cost_ = cost;
  changed_.notify_one();
}

void CaptureThread::note() noexcept {
  counters_ = source_->counters();
  if (const std::string_view said = source_->detail(); !said.empty())
    detail_ = Line{said.data(), said.size()};
}

void CaptureThread::hold(bool held) noexcept {
  const std::scoped_lock lock{mutex_};
  held_ = held;
  fresh_ = false;
}

Expected<DepthFrame> CaptureThread::next(Deadline deadline) noexcept {
  std::unique_lock lock{mutex_};
  const auto patience = std::min<Duration>(deadline.remaining(), std::chrono::seconds{1});
  changed_.wait_for(lock, patience, [this] { return fresh_ || failure_; });
  detail_here_ = detail_;
  if (!fresh_) {
    if (failure_) return tl::unexpected<Error>{*failure_};
    return fail(ErrorCode::kTimeout, "no frame yet");
  }
  fresh_ = false;
  std::swap(newest_, loaned_);
  cost_here_ = cost_;
  return pool_.slot(loaned_).frame;
}

SourceCounters CaptureThread::counters() const noexcept {
  const std::scoped_lock lock{mutex_};
  SourceCounters counters = counters_;
  counters.dropped += overrun_;
  return counters;
}

}  // namespace maplet::daemon
