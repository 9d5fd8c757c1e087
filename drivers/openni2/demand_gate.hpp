// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <OpenNI.h>

#include <condition_variable>
#include <cstddef>
#include <memory>
#include <mutex>
#include <vector>

namespace maplet::openni2 {

/// Holds a recording's player back until a frame is wanted.
///
/// At speed -1 OpenNI2 plays a frame for each trigger, and a reader that waits twice (a short
/// timeout, an event left over) triggers twice: the player then overwrites a frame that nobody has
/// read. The player asks for a buffer before it hands out a frame, on its own thread: making that
/// request wait for demand lets every frame come, in order, whatever the timing.
///
/// Of a camera it is open: its frames land in the buffers and wait for nobody.
///
/// Memory   the buffers, made at construction; a larger request gets memory of its own, as do more
///          frames at once (a recorder that lags behind).
/// Threads  demand() by the reader; the allocator's functions by the player.
class DemandGate final : public openni::VideoStream::FrameAllocator {
 public:
  static constexpr std::size_t kPlayed = 3;  ///< buffers: one with the player, two with us
  static constexpr std::size_t kLive = 6;    ///< and what the runtime and the driver keep

  DemandGate(std::size_t frame_bytes, std::size_t buffers);

  /// One more frame is wanted.
  void demand() noexcept;
  /// Nobody waits here any more: before streams are stopped.
  void open() noexcept;
  /// The player stands at the gate with a frame that nobody has asked for yet.
  [[nodiscard]] bool waiting() const noexcept;

 private:
  struct AlignedDelete {
    void operator()(std::byte* memory) const noexcept;
  };
  using Buffer = std::unique_ptr<std::byte, AlignedDelete>;

  void* allocateFrameBuffer(int size) override;
  void freeFrameBuffer(void* data) override;

  const std::size_t frame_bytes_;
  std::vector<Buffer> buffers_;
  std::vector<bool> used_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  int wanted_ = 0;
  int waiting_ = 0;
  bool open_ = false;
};

}  // namespace maplet::openni2
