// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/eval/patch_score.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tools/eval/segmentation.hpp"

namespace maplet::eval {

namespace {

double nees(const Eigen::Vector3d& error, const Eigen::Matrix3d& information) {
  return error.dot(information * error) / 3.0;
}

/// The one true label under a patch, or 0 when there are several or none.
std::uint16_t only_label(std::span<const std::uint16_t> labels, int width, const Patch& patch) {
  std::uint16_t only = 0;
  for (int v = patch.v_px; v < patch.v_px + patch.height_px; ++v) {
    for (int u = patch.u_px; u < patch.u_px + patch.width_px; ++u) {
      const std::uint16_t label = labels[static_cast<std::size_t>(v * width + u)];
      if (label == 0) continue;
      if (only != 0 && label != only) return 0;
      only = label;
    }
  }
  return only;
}

}  // namespace

void PatchScore::add(const DepthFrame& frame, const PatchSet& set,
                     std::span<const std::uint16_t> found) {
  double frame_valid = 0, frame_labelled = 0;
  for (int v = 0; v < frame.depth.height_px; ++v) {
    for (int u = 0; u < frame.depth.width_px; ++u) {
      const std::uint16_t raw = frame.depth.at(u, v);
      if (raw == 0 || raw == 65535) continue;
      frame_valid += 1;
      const std::uint16_t label = found[static_cast<std::size_t>(v * frame.depth.width_px + u)];
      if (label == 0) continue;
      frame_labelled += 1;
      const double w = 1.0 / (raw * frame.metres_per_unit);
      const double residual = w - set.planes[label - 1U].theta.dot(frame.camera.ray(u, v));
      within_3_sigma += std::abs(residual) <= 3.0 * frame.noise.sigma_inverse_depth(w) ? 1 : 0;
    }
  }
  ++frames;
  valid += frame_valid;
  labelled += frame_labelled;
  if (frame_valid > 0) coverage.push_back(frame_labelled / frame_valid);
}

void PatchScore::add_truth(const DepthFrame& frame, const PatchSet& set,
                           std::span<const std::uint16_t> found,
                           std::span<const std::uint16_t> truth, const TruePlane& true_plane) {
  const SegmentationScore score = score_segmentation(truth, found, frame.depth.width_px);
  regions += score.regions;
  correct += score.correct.size();
  over += score.over;
  under += score.under;
  missed += score.missed;
  noise += score.noise;
  for (const auto& match : score.correct) {
    const std::optional<Plane> should = true_plane(match.truth);
    if (!should) continue;
    const FramePlane& plane = set.planes[match.found - 1U];
    const Plane is = plane.plane();
    const double sine = is.n.cross(should->n).norm();
    angle_deg.push_back(std::asin(std::min(1.0, sine)) * 180.0 / std::numbers::pi);
    offset_mm.push_back(std::abs(is.d - should->d) * 1e3);
    plane_nees.push_back(nees(plane.theta - should->theta(), plane.information));
  }
  for (const Patch& patch : set.patches) {
    const std::uint16_t id = only_label(truth, frame.depth.width_px, patch);
    const std::optional<Plane> should = id == 0 ? std::nullopt : true_plane(id);
    if (should) patch_nees.push_back(nees(patch.theta - should->theta(), patch.information));
  }
}

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  const auto k = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), values.begin() + k, values.end());
  return values[static_cast<std::size_t>(k)];
}

double mean(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double v : values) sum += v;
  return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
}

}  // namespace maplet::eval
