// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "transport/exchange/delta_pose_record.hpp"
#include "transport/exchange/range_record.hpp"

namespace maplet {

/// Who uses what is heard: the estimator's side.
class RecordTaker {
 public:
  virtual ~RecordTaker() = default;

  /// Each record of others comes once. @return false when there is no room now: it will come again
  [[nodiscard]] virtual bool take(const DeltaPoseRecord& record) noexcept = 0;
  [[nodiscard]] virtual bool take(const RangeRecord& record) noexcept = 0;
  /// @param bytes  an encoded maplet, checksum verified; valid during the call
  [[nodiscard]] virtual bool take(const MapletKey& key,
                                  std::span<const std::byte> bytes) noexcept = 0;

  /// How much a maplet that others hold is wanted: the largest comes first, below 0 not at all.
  /// @param saliency  0..1, as its holder says
  [[nodiscard]] virtual float wish(const MapletKey& key, float saliency) noexcept = 0;
};

}  // namespace maplet
