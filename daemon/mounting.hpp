// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "core/agent/plane_hold.hpp"
#include "daemon/config.hpp"
#include "drivers/line.hpp"

namespace maplet::daemon {

/// Which way is up before the first view: as configured, or expected along the body's z.
[[nodiscard]] Mounting mounting_of(const Se3& T_body_camera, const Vector3OrAuto& up) noexcept;
[[nodiscard]] Mounting mounting_of(const BodyConfig& body);

/// What a person should be asked about the two keys that say how the camera sits: a line, or
/// nothing.
[[nodiscard]] std::string mounting_doubt(const BodyConfig& body);

/// The same of a plane that the camera does not keep to, or that nothing was seen of. No heap.
[[nodiscard]] Line plane_doubt(const std::optional<PlaneHold::Report>& plane) noexcept;

}  // namespace maplet::daemon
