// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>

#include "tools/files/surface.hpp"

namespace maplet::draw {

/// Which way is up, from what was seen: the direction that most area lies across (floor, tables,
/// ceiling) or along (walls, at half the weight), within 45 degrees of `hint`; then the eigenvector
/// that fits both best. Where nothing tells, the hint.
/// @param surfaces  in one frame
/// @return unit length, that frame
[[nodiscard]] Eigen::Vector3d find_up(std::span<const files::Surface> surfaces,
                                      const Eigen::Vector3d& hint);

/// The page's axes as rows: right and top, along and across most walls, and up. R_page_world.
/// @param forward  where the first camera looks; of the four ways to lay the walls along the page
///   the one where it looks to the top or, failing that, right
[[nodiscard]] Eigen::Matrix3d lay_out(std::span<const files::Surface> surfaces,
                                      const Eigen::Vector3d& up, const Eigen::Vector3d& forward);

}  // namespace maplet::draw
