// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "tools/draw/plan.hpp"

namespace maplet::draw {

/// The picture as a whole: title, figures, map, legend and scale bar, 1600 pixels wide.
/// @param title  the headline
/// @param file   *.svg or *.png
/// @throws std::runtime_error  naming the file, when its kind is neither or it cannot be written
void draw_sheet(const Plan& plan, const std::string& title, const std::filesystem::path& file);

/// The line of figures under the title.
[[nodiscard]] std::string figures(const PlanCounts& counts);

/// The longest of 1, 2, 5, 10, 20... (and 0.5, 0.2...) metres that is no longer than `longest_m`.
[[nodiscard]] double scale_bar_m(double longest_m);

}  // namespace maplet::draw
