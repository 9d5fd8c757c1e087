// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// How the extractor spends a budget: docs/math/patches.md, section 6.
#include <algorithm>
#include <cmath>

#include "core/patches/extractor.hpp"

namespace maplet {

namespace {

// What a frame costs on a busy 3 GHz x86: at all, a pixel that is read, a cell of 8 px that is
// carried to the end (a coarser one costs by the root of its size more), a pixel of the image in
// the second look. A slower machine finds its plan too ambitious and is cut by the stages'
// deadlines.
constexpr double kFrameNs = 20e3;
constexpr double kPixelNs = 0.9;
constexpr double kCellNs = 240.0;
constexpr double kLookNs = 2.1;
/// Writing the result takes what is left behind the second look.
constexpr double kWriteNs = 10e3;
constexpr double kWritePatchNs = 150.0;
/// The rest of a budget is for what was underestimated, and for a coarse grain's second look.
constexpr double kPlanShare = 0.68;
constexpr int kCoarsestCellPx = 128;

}  // namespace

PatchExtractor::Plan PatchExtractor::plan(const DepthFrame& frame,
                                          Deadline deadline) const noexcept {
  Plan out{pyramid_.finest(frame.depth.width_px, frame.depth.height_px), true, deadline, deadline,
           deadline};
  const Duration left = deadline.remaining();
  if (left == Duration::max()) return out;
  const double pixels = static_cast<double>(frame.depth.width_px) * frame.depth.height_px;
  const double left_ns = static_cast<double>(std::max(left, Duration{0}).count());
  const auto cells = [&] { return pixels / (out.grain.cell_px * out.grain.cell_px); };
  const auto fits = [&] {
    const double cell_ns = kCellNs * std::sqrt(out.grain.cell_px / 8.0);
    const double front = kFrameNs + pixels * kPixelNs / out.grain.row_step + cells() * cell_ns;
    // The finest grain is worth it only with its second look; coarser ones take what there is.
    const double look = out.finest && config_.second_look ? pixels * kLookNs : 0.0;
    return front + look <= left_ns * kPlanShare;
  };
  while (!fits() && out.grain.cell_px < kCoarsestCellPx) {
    out.finest = false;
    // Both together keep the whole image in view, and a cell at eight rows.
    out.grain.cell_px *= 2;
    out.grain.row_step *= 2;
  }
  const auto share = [&](double part) {
    return deadline.within(Duration{static_cast<std::int64_t>(left_ns * part)});
  };
  out.fill = share(0.6);
  out.split = share(0.75);
  out.merge = share(0.9);
  return out;
}

Deadline PatchExtractor::before_writing(Deadline deadline) const noexcept {
  const Duration left = deadline.remaining();
  if (left == Duration::max()) return deadline;
  const double write_ns = kWriteNs + static_cast<double>(tree_.patch_count()) * kWritePatchNs;
  return deadline.within(left - Duration{static_cast<std::int64_t>(write_ns)});
}

}  // namespace maplet
