// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <tl/expected.hpp>

namespace maplet {

/// What went wrong in the environment. Overload is counted, bugs terminate; neither is an Error.
enum class ErrorCode : std::uint8_t {
  kTimeout,    ///< nothing came in time: try again
  kDevice,     ///< the device failed: reopen it
  kEnd,        ///< the recording is over
  kBadInput,   ///< bytes from outside make no sense
  kIo,         ///< a file or socket cannot be read or written
  kNoOverlap,  ///< two views or maplets share too little
  kCapacity,   ///< a fixed capacity is used up
};

/// Memory   no allocation: `what` is a string literal.
struct Error {
  ErrorCode code;
  const char* what;
};

template <class T>
using Expected = tl::expected<T, Error>;

[[nodiscard]] inline tl::unexpected<Error> fail(ErrorCode code, const char* what) noexcept {
  return tl::unexpected<Error>{Error{code, what}};
}

}  // namespace maplet
