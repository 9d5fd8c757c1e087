// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Included by this folder's sources only.
#pragma once

#include <dds/dds.h>

#include "core/base/clock.hpp"

namespace maplet {

/// Notices participants and subscribers that have just shown up.
///
/// Threads  one at a time.
class Arrivals {
 public:
  Arrivals(dds_entity_t participant, dds_entity_t writer) noexcept;

  /// How long nobody new has shown up, counted from the construction.
  [[nodiscard]] Duration quiet_for(Instant now) noexcept;

 private:
  dds_entity_t participants_;  ///< built-in reader; ends with its participant
  dds_entity_t writer_;
  std::uint32_t matches_ = 0;
  Instant last_;
};

}  // namespace maplet
