// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <compare>
#include <cstdint>
#include <string_view>

namespace maplet {

/// What an agent numbers apart from everything else.
enum class Stream : std::uint8_t { kDeltaPoses, kClosures, kRanges, kMaplets };
inline constexpr std::size_t kStreams = 4;

[[nodiscard]] constexpr std::string_view to_string(Stream stream) noexcept {
  switch (stream) {
    case Stream::kDeltaPoses:
      return "delta_poses";
    case Stream::kClosures:
      return "closures";
    case Stream::kRanges:
      return "ranges";
    case Stream::kMaplets:
      return "maplets";
  }
  return "?";
}

/// Names one record for ever: a key never names two contents.
struct RecordKey {
  std::uint16_t agent = 0;
  std::uint32_t epoch = 0;  ///< one life of the agent
  Stream stream = Stream::kDeltaPoses;
  std::uint32_t seq = 0;  ///< counts up from 0

  friend auto operator<=>(const RecordKey&, const RecordKey&) = default;
};

}  // namespace maplet
