// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

namespace maplet {

/// From when to when keys may be used: seconds since 1970, UTC, by anybody's clock give or take.
struct Validity {
  std::int64_t not_before_s = 0;
  std::int64_t not_after_s = 0;

  enum class State : std::uint8_t { kGood, kNotYet, kExpired };
  [[nodiscard]] State at(std::int64_t now_s, std::int64_t tolerance_s) const noexcept {
    if (now_s < not_before_s - tolerance_s) return State::kNotYet;
    return now_s > not_after_s + tolerance_s ? State::kExpired : State::kGood;
  }

  friend bool operator==(const Validity&, const Validity&) = default;
};

/// "2026-11-27 00:18:00 UTC".
[[nodiscard]] std::string utc(std::int64_t time_s);

/// Why keys may not be used now: both times and the tolerance; empty: they may.
[[nodiscard]] std::string problem(const Validity& validity, std::int64_t now_s,
                                  std::int64_t tolerance_s);

}  // namespace maplet
