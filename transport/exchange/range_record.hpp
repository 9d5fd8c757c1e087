// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "core/base/clock.hpp"
#include "core/base/expected.hpp"
#include "core/maplet/maplet.hpp"
#include "core/registration/maplet_range.hpp"
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

/// @return kBadInput when no record can hold it
[[nodiscard]] inline Expected<RangeRecord> quantise(const MapletRange& range, std::uint16_t agent,
                                                    std::uint32_t epoch,
                                                    std::uint32_t seq) noexcept {
  if (!(range.range_m >= 0.0 && range.range_m <= 1e4 && range.sigma_m > 0.0 &&
        range.sigma_m < 65.0)) {
    return fail(ErrorCode::kBadInput, "range: beyond what a record holds");
  }
  RangeRecord record{{agent, epoch, Stream::kRanges, seq}, range.a, range.b, range.stamp, 0, 0};
  record.range_mm = static_cast<std::uint32_t>(std::lround(range.range_m * 1e3));
  record.sigma_mm = static_cast<std::uint16_t>(std::ceil(range.sigma_m * 1e3));
  if (!valid(record)) return fail(ErrorCode::kBadInput, "range: between a maplet and itself");
  return record;
}

[[nodiscard]] inline MapletRange restore(const RangeRecord& record) noexcept {
  return {record.a, record.b, record.stamp, record.range_mm * 1e-3, record.sigma_mm * 1e-3};
}

}  // namespace maplet
