// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string_view>

#include "core/geometry/se3.hpp"

namespace maplet::daemon {

/// A pose as configurations have it: x,y,z,qx,qy,qz,qw. Nothing when it is none.
[[nodiscard]] std::optional<Se3> pose_of(std::string_view text);

}  // namespace maplet::daemon
