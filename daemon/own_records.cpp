// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/own_records.hpp"

#include <cstdlib>

namespace maplet::daemon {

std::optional<DeltaPose> OwnRecords::put(const DeltaPose& delta) noexcept {
  std::uint32_t& seq = next_seq_[static_cast<std::size_t>(stream_of(delta.kind))];
  const auto record = quantise(delta, identity_.agent, identity_.epoch, seq);
  if (!record) {
    ++refused_;
    return std::nullopt;
  }
  if (full(pending_)) std::abort();  // a bug: a step gives few
  ++seq;
  pending_.push_back(*record);
  return restore(*record);
}

std::optional<MapletRange> OwnRecords::put(const MapletRange& range) noexcept {
  std::uint32_t& seq = next_seq_[static_cast<std::size_t>(Stream::kRanges)];
  const auto record = quantise(range, identity_.agent, identity_.epoch, seq);
  if (!record) {
    ++refused_;
    return std::nullopt;
  }
  if (full(pending_ranges_)) std::abort();  // a bug: a step gives few
  ++seq;
  pending_ranges_.push_back(*record);
  return restore(*record);
}

}  // namespace maplet::daemon
