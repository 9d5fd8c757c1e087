// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "core/frame/depth_frame.hpp"
#include "core/patches/patch.hpp"

namespace maplet::draw {

/// Writes a PNG: the frame in gray, its planes in colours, the quadtree's patches as thin squares,
/// a caption below.
///
/// @param labels  plane + 1 of each pixel, 0 = none
/// Throws std::runtime_error when the file cannot be written.
void draw_patches(const std::filesystem::path& file, const DepthFrame& frame, const PatchSet& set,
                  std::span<const std::uint16_t> labels, const std::string& caption);

}  // namespace maplet::draw
