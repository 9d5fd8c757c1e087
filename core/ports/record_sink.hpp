// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "core/registration/delta_pose.hpp"
#include "core/registration/maplet_range.hpp"

namespace maplet {

/// Makes records of what the agent finds out. The exchange implements it.
class RecordSink {
 public:
  virtual ~RecordSink() = default;

  /// Numbers the delta-pose as the next record of its stream.
  /// @return it as everybody will read it, quantised for the wire: the agent goes on with this one;
  ///   nothing when no record can hold it (not finite, longer than 512 m): the two maplets then
  ///   stay without a relation
  [[nodiscard]] virtual std::optional<DeltaPose> put(const DeltaPose& delta) noexcept = 0;
  /// The same for a range between two agents.
  [[nodiscard]] virtual std::optional<MapletRange> put(const MapletRange& range) noexcept = 0;
};

}  // namespace maplet
