// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <string_view>

#include "core/base/clock.hpp"

namespace maplet {

/// A point in time that a stage must not run past. Cheap: pass by value.
class Deadline {
 public:
  Deadline(const Clock& clock, Duration budget) noexcept
      : clock_{&clock}, end_{clock.now() + budget} {}

  /// A deadline that never passes: limits in counts and iterations decide.
  [[nodiscard]] static Deadline never() noexcept { return {}; }

  [[nodiscard]] bool expired() const noexcept { return clock_ != nullptr && clock_->now() >= end_; }

  /// Time left, negative when it has passed; Duration::max() when it never does.
  [[nodiscard]] Duration remaining() const noexcept {
    return clock_ == nullptr ? Duration::max() : end_ - clock_->now();
  }

  /// A tighter deadline inside this one; never a later one.
  [[nodiscard]] Deadline within(Duration budget) const noexcept {
    if (clock_ == nullptr) return *this;
    return {*clock_, std::min(end_, clock_->now() + budget)};
  }

 private:
  Deadline() noexcept = default;
  Deadline(const Clock& clock, Instant end) noexcept : clock_{&clock}, end_{end} {}

  const Clock* clock_ = nullptr;
  Instant end_{};
};

/// Why a stage stopped. Every value comes with a usable result.
enum class Stop : std::uint8_t {
  kConverged,       ///< nothing left to improve
  kIterationLimit,  ///< a limit in counts (iterations, patches) was reached
  kDeadline,        ///< the time was used up
};

[[nodiscard]] constexpr std::string_view to_string(Stop stop) noexcept {
  switch (stop) {
    case Stop::kConverged:
      return "converged";
    case Stop::kIterationLimit:
      return "limit";
    case Stop::kDeadline:
      return "deadline";
  }
  return "?";
}

}  // namespace maplet
