// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>

#include "core/ports/depth_source.hpp"
#include "daemon/pacer.hpp"
#include "drivers/line.hpp"

namespace maplet::daemon {

/// Room for the frames between the thread that reads them and the one that works at them: one is
/// filled, one waits, one is on loan.
///
/// Memory   reserved at construction; only what frames fill is ever touched.
class FramePool {
 public:
  static constexpr std::size_t kFrames = 3;

  struct Slot {
    std::unique_ptr<std::uint16_t[]> depth;
    std::unique_ptr<std::uint8_t[]> gray;
    DepthFrame frame;
  };

  /// @param pixels  of the largest frame
  explicit FramePool(std::size_t pixels);
  [[nodiscard]] std::size_t pixels() const noexcept { return pixels_; }
  [[nodiscard]] Slot& slot(std::size_t index) noexcept { return slots_[index]; }

  /// What the frames of a camera of so many pixels take.
  [[nodiscard]] static constexpr std::size_t bytes(std::size_t pixels) noexcept {
    return kFrames * pixels * (sizeof(std::uint16_t) + sizeof(std::uint8_t));
  }

 private:
  std::size_t pixels_;
  std::array<Slot, kFrames> slots_;
};

/// What reading one frame cost.
struct ReadCost {
  Duration wall{};
  Duration cpu{};
  std::optional<Instant> came{};  ///< when the device's runtime had it
};

/// A source on a thread of its own: however long a frame is worked at, the camera is read; the
/// newest frame wins, and those that nobody had time for are counted as dropped.
///
/// Memory   the pool's.
/// Threads  one of its own, which alone calls the source; next() and the rest: one caller.
class CaptureThread final : public DepthSource {
 public:
  /// @param enter  called on the new thread first: name, priority
  CaptureThread(std::unique_ptr<DepthSource> source, Pace pace, FramePool& pool,
                const std::function<void()>& enter);
  ~CaptureThread() override;
  CaptureThread(const CaptureThread&) = delete;
  CaptureThread& operator=(const CaptureThread&) = delete;

  /// The newest frame that was not yet asked for. @return as the source
  [[nodiscard]] Expected<DepthFrame> next(Deadline deadline) noexcept override;
  [[nodiscard]] SourceCounters counters() const noexcept override;
  [[nodiscard]] std::string_view detail() const noexcept override { return view(detail_here_); }
  [[nodiscard]] std::optional<std::uint64_t> length() const noexcept override { return length_; }
  /// Until it is let go again frames are read and let pass, uncounted; one that waits is forgotten.
  void hold(bool held) noexcept;
  /// Of the frame that next() gave last.
  [[nodiscard]] ReadCost cost() const noexcept { return cost_here_; }

 private:
  void loop() noexcept;
  /// Fills the free slot. @return false when the frame has no room there
  [[nodiscard]] bool fill(const DepthFrame& frame) noexcept;
  void offer(ReadCost cost) noexcept;
  void note() noexcept;

  std::unique_ptr<DepthSource> source_;
  FramePool& pool_;
  Pacer pacer_;
  std::optional<std::uint64_t> length_;

  // The capture thread's.
  std::size_t filling_ = 0;
  // Both threads', under the lock.
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::size_t newest_ = 1;
  bool fresh_ = false;            ///< `newest_` waits to be taken
  std::optional<Error> failure_;  ///< the source's last word
  SourceCounters counters_;
  std::uint64_t overrun_ = 0;
  ReadCost cost_;
  Line detail_;
  // The caller's.
  std::size_t loaned_ = 2;
  ReadCost cost_here_;
  Line detail_here_;

  std::atomic<bool> held_{false};
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace maplet::daemon
