// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstring>
#include <memory>
#include <span>
#include <type_traits>
#include <vector>

#include "core/base/expected.hpp"
#include "core/frame/depth_frame.hpp"
#include "drivers/flight/events.hpp"
#include "drivers/flight/flight_file.hpp"

namespace maplet::flight {

/// The events of a recording, one after the other, and the pixels that follow a frame's.
///
/// Errors   what cannot be read ends the recording: what came after it would be taken for what came
///          then. Memory  a block of events and one frame; allocates. Threads  one.
class EventReader {
 public:
  /// @param most  the largest image that there is room for
  EventReader(std::unique_ptr<RingReader> ring, ImageSize most) noexcept
      : ring_{std::move(ring)}, most_{most} {}

  /// @return what comes next; Event{} at the end
  [[nodiscard]] Event peek() noexcept;
  /// Of the next event; until pass().
  [[nodiscard]] std::span<const std::byte> body() noexcept;
  void pass() noexcept;

  /// Of the next event, when it is an `event`; leaves it there.
  /// @return false: another, or too short
  template <class T>
  [[nodiscard]] bool look(Event event, T& value) noexcept {
    static_assert(std::is_trivially_copyable_v<T>);
    if (peek() != event || body().size() < sizeof value) return false;
    std::memcpy(static_cast<void*>(&value), body().data(), sizeof value);
    return true;
  }

  /// The next frame; what lies before it goes.
  /// @return kEnd at the end of the loop or of what can be read; the error that the source gave
  /// then
  [[nodiscard]] Expected<DepthFrame> frame() noexcept;

  /// The loop was over here, or nothing more is recorded.
  [[nodiscard]] bool over() noexcept;
  /// Once a round of a loop that may wait for what does not come, as when it asks for other things
  /// than the run that was recorded: then the next event goes.
  void keep_going() noexcept;
  [[nodiscard]] bool damaged() const noexcept { return damaged_; }

 private:
  [[nodiscard]] bool fill() noexcept;
  [[nodiscard]] bool read_block(Block type, std::vector<std::byte>& out) noexcept;
  [[nodiscard]] bool read_pixels(FrameNumbers& numbers) noexcept;

  std::unique_ptr<RingReader> ring_;
  ImageSize most_;
  std::vector<std::byte> events_;
  std::size_t at_ = 0;
  bool damaged_ = false;
  std::uint64_t passed_ = 0;
  std::uint64_t passed_before_ = 0;  ///< at the last keep_going()
  std::vector<std::byte> block_;
  std::vector<std::uint16_t> depth_;
  std::vector<std::byte> gray_;
};

}  // namespace maplet::flight
