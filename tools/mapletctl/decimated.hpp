// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "core/frame/depth_frame.hpp"

namespace maplet::ctl {

/// Frames that keep every `step`-th pixel; step 1 hands them through.
class Decimated {
 public:
  explicit Decimated(int step) : step_{step} {}

  /// @return valid until the next call
  [[nodiscard]] DepthFrame of(const DepthFrame& frame) {
    if (step_ == 1) return frame;
    DepthFrame out = frame;
    out.camera = frame.camera.decimated(step_);
    out.noise.correlated_px = std::max(1.0, frame.noise.correlated_px / (step_ * step_));
    out.depth = pick(frame.depth, depth_);
    if (!frame.gray.empty()) out.gray = pick(frame.gray, gray_);
    return out;
  }
  [[nodiscard]] std::span<const std::uint16_t> labels(std::span<const std::uint16_t> all,
                                                      int width_px) {
    if (step_ == 1) return all;
    const int height = static_cast<int>(all.size()) / width_px;
    (void)pick(ImageView<std::uint16_t>{all.data(), width_px, height, width_px}, labels_);
    return labels_;
  }

 private:
  template <class Pixel>
  ImageView<Pixel> pick(const ImageView<Pixel>& in, std::vector<Pixel>& out) const {
    out.clear();
    for (int v = 0; v < in.height_px; v += step_) {
      for (int u = 0; u < in.width_px; u += step_) out.push_back(in.at(u, v));
    }
    const int width = (in.width_px + step_ - 1) / step_;
    return {out.data(), width, (in.height_px + step_ - 1) / step_, width};
  }

  int step_;
  std::vector<std::uint16_t> depth_, labels_;
  std::vector<std::uint8_t> gray_;
};

}  // namespace maplet::ctl
