// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "core/base/clock.hpp"
#include "core/maplet/maplet.hpp"
#include "transport/exchange/record_key.hpp"

namespace maplet {

/// A distance between two agents, carried to the origins of the maplets that they were in.
struct RangeRecord {
  RecordKey key;
  MapletKey a;  ///< of the agent that measured
  MapletKey b;  ///< of the other
  Stamp stamp{};
  std::uint32_t range_mm = 0;
  std::uint16_t sigma_mm = 0;

  friend bool operator==(const RangeRecord&, const RangeRecord&) = default;
};

/// False when a record from outside makes no sense.
[[nodiscard]] inline bool valid(const RangeRecord& record) noexcept {
  return record.key.stream == Stream::kRanges && record.sigma_mm > 0 && record.a != record.b &&
         record.range_mm <= 10'000'000;
}

}  // namespace maplet
