// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/own_records.hpp"

#include <cstdlib>

namespace maplet::daemon {

DeltaPose OwnRecords::put(const DeltaPose& delta) noexcept {
  std::uint32_t& seq = next_seq_[static_cast<std::size_t>(stream_of(delta.kind))];
  const auto record = quantise(delta, identity_.agent, identity_.epoch, seq);
  // The registrar gives finite poses with valid covariances, and a step gives few: else it is a
  // bug.
  if (!record || full(pending_)) std::abort();
  ++seq;
  pending_.push_back(*record);
  return restore(*record);
}

}  // namespace maplet::daemon
