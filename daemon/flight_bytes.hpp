// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include "core/maplet/maplet.hpp"

/// How events lie in a flight recorder's block: what flight_log.cpp writes and flight_replay.cpp
/// reads.
namespace maplet::daemon {

inline constexpr std::size_t kEventHead = 3;  ///< tag, length

template <class T>
std::span<const std::byte> bytes_of(const T& value) noexcept {
  return std::as_bytes(std::span{&value, 1});
}

template <class T>
bool value_of(std::span<const std::byte> body, T& value) noexcept {
  if (body.size() < sizeof value) return false;
  std::memcpy(static_cast<void*>(&value), body.data(), sizeof value);
  return true;
}

/// An operator's word.
struct Said {
  MapletKey a;
  MapletKey b;
  std::array<double, 7> T{};
  std::uint8_t accept = 0;
};

}  // namespace maplet::daemon
