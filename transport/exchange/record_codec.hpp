// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/base/expected.hpp"
#include "transport/exchange/byte_io.hpp"
#include "transport/exchange/delta_pose_record.hpp"
#include "transport/exchange/range_record.hpp"

namespace maplet {

/// What the records before it in a datagram say about the next one: consecutive delta-poses share
/// agent, epoch, a maplet and a stamp. Both ends start a datagram with the same context.
struct RecordContext {
  explicit RecordContext(std::uint16_t agent, std::uint32_t epoch) noexcept
      : key{agent, epoch, Stream::kDeltaPoses, 0xFFFFFFFF} {}

  RecordKey key;            ///< of the record before
  bool has_maplet = false;  ///< the two below are known
  MapletKey b;              ///< its second maplet
  Stamp stamp_b{};
};

/// Bytes of a delta-pose or closure on the radio, after its entry's head. Lossless: what is read is
/// what was written.
///
/// Math   docs/math/records.md, section "On the radio".
void write_record(ByteWriter& out, RecordContext& context, const DeltaPoseRecord& record) noexcept;
void write_record(ByteWriter& out, RecordContext& context, const RangeRecord& record) noexcept;

/// @return kBadInput when the bytes are no record that an honest agent writes
[[nodiscard]] Expected<DeltaPoseRecord> read_delta_pose(ByteReader& in,
                                                        RecordContext& context) noexcept;
[[nodiscard]] Expected<RangeRecord> read_range(ByteReader& in, RecordContext& context) noexcept;

/// At most so many bytes for one record of any kind, its entry's head included.
inline constexpr std::size_t kMaxRecordBytes = 160;

}  // namespace maplet
