// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/security/validity.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <ctime>

namespace maplet {

std::string utc(std::int64_t time_s) {
  constexpr std::int64_t kYear9999 = 253402300799;
  const auto time = static_cast<std::time_t>(std::clamp<std::int64_t>(time_s, 0, kYear9999));
  return fmt::format("{:%Y-%m-%d %H:%M:%S} UTC", fmt::gmtime(time));
}

std::string problem(const Validity& validity, std::int64_t now_s, std::int64_t tolerance_s) {
  switch (validity.at(now_s, tolerance_s)) {
    case Validity::State::kGood:
      return {};
    case Validity::State::kNotYet:
      return fmt::format(
          "not valid before {}, and this machine's clock says {} (tolerance {} s): set the clock, "
          "or raise security.clock_tolerance_s",
          utc(validity.not_before_s), utc(now_s), tolerance_s);
    case Validity::State::kExpired:
      return fmt::format(
          "expired at {}, and this machine's clock says {} (tolerance {} s): mapletctl keys rotate "
          "makes the next ones; or set the clock",
          utc(validity.not_after_s), utc(now_s), tolerance_s);
  }
  return {};
}

}  // namespace maplet
