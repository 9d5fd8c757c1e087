// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <istream>
#include <optional>
#include <string_view>
#include <vector>

#include "core/base/clock.hpp"
#include "core/geometry/se3.hpp"

namespace maplet::eval {

/// A pose with the time it was true at: T_world_camera.
struct StampedPose {
  Stamp stamp{};
  Se3 pose;
};

/// Ordered by stamp.
using Trajectory = std::vector<StampedPose>;

/// A decimal number of seconds, exactly: digits beyond the nanosecond are cut off, none is lost to
/// binary fractions. Takes an exponent ("1.3e+09"), as numpy writes them.
/// @return nothing when `text` is no such number or does not fit 64-bit nanoseconds
[[nodiscard]] std::optional<Stamp> parse_stamp(std::string_view text) noexcept;

/// Lines `stamp x y z qx qy qz qw`, TUM's format; `#` begins a comment, empty lines are skipped.
/// @param name  what messages call the input
/// @throws std::runtime_error  "name:line: what is wrong" for a line that is no pose: other than
///   eight numbers, not finite, a quaternion that is not of unit length (1 % off is rounding)
[[nodiscard]] Trajectory read_tum(std::istream& in, std::string_view name);

/// @throws std::runtime_error  also when the file cannot be read
[[nodiscard]] Trajectory read_tum(const std::filesystem::path& file);

}  // namespace maplet::eval
