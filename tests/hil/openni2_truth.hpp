// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdlib>
#include <stdexcept>
#include <string>

#include "core/frame/depth_frame.hpp"
#include "drivers/sim/sim_source.hpp"

namespace maplet::test {

/// What the synthetic camera must have seen (world=room sim.seed=3 sim.noise=0): the simulator's
/// own frame, found by its stamp.
class Truth {
 public:
  Truth(int width_px, double rate_hz) : source_{open(width_px)}, rate_hz_{rate_hz} {}

  [[nodiscard]] static CameraModel camera(int width_px) { return open(width_px)->camera(); }

  [[nodiscard]] bool same_depth(const DepthFrame& got) const {
    return same(got.depth, frame(got).depth);
  }
  /// As same_depth(), but for the end of the last row: OpenNI2's 16z encoder swaps a pending half
  /// byte and a pending run of equal pixels there, so up to 30 pixels come back up to 6 mm off.
  [[nodiscard]] bool same_recorded_depth(const DepthFrame& got) const {
    const DepthFrame want = frame(got);
    auto rows_above = [](ImageView<std::uint16_t> image) { return --image.height_px, image; };
    if (!same(rows_above(got.depth), rows_above(want.depth))) return false;
    const int last = want.depth.height_px - 1;
    int off = 0;
    for (int u = 0; u < want.depth.width_px; ++u) {
      const int by = std::abs(got.depth.at(u, last) - want.depth.at(u, last));
      off += by != 0;
      if (by > 6) return false;
    }
    return off <= 30;
  }
  [[nodiscard]] bool same_gray(const DepthFrame& got) const {
    return same(got.gray, frame(got).gray);
  }

 private:
  static std::unique_ptr<SimSource> open(int width_px) {
    auto world =
        open_sim("room", {{"seed", "3"}, {"noise", "0"}, {"width", std::to_string(width_px)}});
    if (!world) throw std::runtime_error(world.error());
    return std::move(*world);
  }

  [[nodiscard]] DepthFrame frame(const DepthFrame& got) const {
    source_->seek(static_cast<std::uint64_t>(std::llround(seconds(got.stamp) * rate_hz_)));
    return source_->next(Deadline::never()).value();
  }

  template <class Pixel>
  static bool same(const ImageView<Pixel>& a, const ImageView<Pixel>& b) {
    if (a.width_px != b.width_px || a.height_px != b.height_px) return false;
    for (int v = 0; v < a.height_px; ++v) {
      for (int u = 0; u < a.width_px; ++u) {
        if (a.at(u, v) != b.at(u, v)) return false;
      }
    }
    return true;
  }

  std::unique_ptr<SimSource> source_;
  double rate_hz_;
};

}  // namespace maplet::test
