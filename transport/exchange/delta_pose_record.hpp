// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/base/expected.hpp"
#include "core/registration/delta_pose.hpp"
#include "transport/exchange/covariance_code.hpp"
#include "transport/exchange/record_key.hpp"

namespace maplet {

/// A delta-pose as quantised for the wire. Every agent, the origin too, computes with
/// restore(record), so that all hold the same numbers.
///
/// Math   docs/math/records.md, eq. 1-5.
struct DeltaPoseRecord {
  RecordKey key;
  DeltaPose::Kind kind = DeltaPose::Kind::kConsecutive;
  MapletKey a;
  MapletKey b;
  Stamp stamp_a{};
  Stamp stamp_b{};
  std::array<float, 3> translation_m{};  ///< multiples of 2^-14 m, within +-512 m
  std::array<float, 3> rotation_rad{};   ///< rotation vector; multiples of 2^-21 rad
  CovarianceCode covariance;
  /// Motion in this plane: the numbers above are in its axes (right, down, forward), zero out of it
  /// and known to PlanarMotion::kTold there. kSpace: in the camera's.
  PlaneCode plane = PlaneCode::kSpace;
  std::uint8_t overlap = 0;  ///< of 255
  std::uint8_t matches = 0;  ///< 255: that many or more

  friend bool operator==(const DeltaPoseRecord&, const DeltaPoseRecord&) = default;
};

/// Of a planar record's six numbers those that say something: right, forward, the turn about down.
[[nodiscard]] constexpr bool in_plane(std::size_t axis) noexcept {
  return axis == 0 || axis == 2 || axis == 4;
}

/// Serialised in the local domain: CDR with its 4-byte header (tests/unit/dds measures it).
inline constexpr std::size_t kDeltaPosePayloadBytes = 156;

/// Which stream a delta-pose belongs to.
[[nodiscard]] constexpr Stream stream_of(DeltaPose::Kind kind) noexcept {
  return kind == DeltaPose::Kind::kClosure ? Stream::kClosures : Stream::kDeltaPoses;
}

/// @param agent,epoch  who makes the record
/// @param seq  of the stream that delta.kind belongs to
/// @return kBadInput when a number is not finite, a variance negative or the translation 512 m long
[[nodiscard]] Expected<DeltaPoseRecord> quantise(const DeltaPose& delta, std::uint16_t agent,
                                                 std::uint32_t epoch, std::uint32_t seq) noexcept;

[[nodiscard]] DeltaPose restore(const DeltaPoseRecord& record) noexcept;

/// False when a record from outside cannot have come from quantise(): never use it.
[[nodiscard]] bool valid(const DeltaPoseRecord& record) noexcept;

}  // namespace maplet
