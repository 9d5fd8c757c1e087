// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "core/base/clock.hpp"

struct gpiod_chip;
struct gpiod_line;

namespace maplet {

/// One line of a GPIO chip, held as long as this lives.
///
/// Memory   libgpiod's, at opening.
/// Threads  one caller at a time. After an error of a call the line is of no use any more.
class GpioLine {
 public:
  enum class Use : std::uint8_t { kOutput, kInput };

  /// @param where       name of the line ("TRACKING"), or CHIP:NAME or CHIP:NUMBER with the chip's
  ///   name or label ("gpiochip0:17"); the first chip that has the name
  /// @param active_low  on = low
  /// @param use         outputs start off; of inputs both edges are heard of
  /// @return one line that says why not: no chip, no such line, taken by whom, not permitted
  [[nodiscard]] static tl::expected<GpioLine, std::string> open(const std::string& where,
                                                                bool active_low, Use use);

  /// Of an output. @return false when the chip refuses (it is gone)
  [[nodiscard]] bool set(bool on) noexcept;
  /// Of an input, now.
  [[nodiscard]] std::optional<bool> value() const noexcept;

  struct Edge {
    bool on = false;  ///< rising, of an active-low line falling
    Instant at{};     ///< the kernel's stamp, monotonic clock
  };
  /// To wait at with poll(). Of an input.
  [[nodiscard]] int event_fd() const noexcept;
  /// The next edge, once event_fd() is readable.
  [[nodiscard]] std::optional<Edge> read_edge() noexcept;

 private:
  struct Release {
    void operator()(gpiod_line* line) const noexcept;
  };
  struct Close {
    void operator()(gpiod_chip* chip) const noexcept;
  };
  std::unique_ptr<gpiod_chip, Close> chip_;
  std::unique_ptr<gpiod_line, Release> line_;
};

/// A GPIO chip of this machine.
struct GpioChip {
  std::string name;   ///< "gpiochip0"
  std::string label;  ///< the driver's
  unsigned lines = 0;
  std::string problem;  ///< why it does not open; empty: it does
};

[[nodiscard]] std::vector<GpioChip> gpio_chips();

}  // namespace maplet
