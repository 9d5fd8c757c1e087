// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "core/maplet/maplet.hpp"
#include "core/registration/icap.hpp"

namespace maplet::ctl {

/// What --planar says of itself.
inline constexpr const char* kPlanarHelp =
    "Both cameras are at one height and tilted alike (one vehicle, one floor): transforms have "
    "three unknowns, across the up that the maplets hold";

/// The plane that a maplet's camera moves in. @throws Failure when it does not say which way is up
[[nodiscard]] PlanarMotion plane_of(const Maplet& maplet, const std::string& name);

/// @throws Failure when another maplet's camera is tilted otherwise
void check_one_plane(const PlanarMotion& plane, const Maplet& other, const std::string& name);

/// {up, delta, covariance}, as in delta_poses.jsonl.
[[nodiscard]] nlohmann::ordered_json planar_json(const MapletAlignment& alignment);

}  // namespace maplet::ctl
