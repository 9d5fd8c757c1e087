// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>
#include <time.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <vector>

#include "core/patches/extractor.hpp"
#include "daemon/progress.hpp"
#include "drivers/open_source.hpp"
#include "drivers/sim/sim_source.hpp"
#include "tools/eval/segmentation.hpp"
#include "tools/mapletctl/command.hpp"
#include "tools/mapletctl/decimated.hpp"
#include "tools/mapletctl/patch_options.hpp"

namespace maplet::ctl {
namespace {

using Json = nlohmann::ordered_json;

struct Options {
  std::vector<std::string> sources;
  PatchOptions patches;
  int frames = 0;
  int decimate = 1;
  bool json = false;
};

double quantile(std::vector<double>& values, double q) {
  if (values.empty()) return 0.0;
  const auto k = static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), values.begin() + k, values.end());
  return values[static_cast<std::size_t>(k)];
}
double mean(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double v : values) sum += v;
  return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
}

/// Everything that is counted over the frames of all sources.
struct Totals {
  std::size_t frames = 0, regions = 0, correct = 0, over = 0, under = 0, missed = 0, noise = 0;
  std::vector<double> us, wall_us, angle_deg, offset_mm, plane_nees, patch_nees, planes, patches;
  double labelled = 0, valid = 0, within = 0;
};

double nees(const Eigen::Vector3d& error, const Eigen::Matrix3d& information) {
  return error.dot(information * error) / 3.0;
}

/// True plane ids under a patch: that of its middle when all its pixels have it, else 0.
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

void compare_with_truth(const SimSource& sim, std::span<const std::uint16_t> truth,
                        const DepthFrame& frame, const PatchSet& set,
                        std::span<const std::uint16_t> found, Totals& totals) {
  const auto score = eval::score_segmentation(truth, found, frame.depth.width_px);
  totals.regions += score.regions;
  totals.correct += score.correct.size();
  totals.over += score.over;
  totals.under += score.under;
  totals.missed += score.missed;
  totals.noise += score.noise;
  const Se3 T_camera_world = sim.T_world_camera().se3.inverse();
  const auto true_plane = [&](std::uint16_t id) { return T_camera_world * sim.planes()[id - 1U]; };
  for (const auto& match : score.correct) {
    const FramePlane& plane = set.planes[match.found - 1U];
    const Plane is = plane.plane();
    const Plane should = true_plane(match.truth);
    const double sine = is.n.cross(should.n).norm();
    totals.angle_deg.push_back(std::asin(std::min(1.0, sine)) * 180.0 / std::numbers::pi);
    totals.offset_mm.push_back(std::abs(is.d - should.d) * 1e3);
    totals.plane_nees.push_back(nees(plane.theta - should.theta(), plane.information));
  }
  for (const Patch& patch : set.patches) {
    const std::uint16_t id = only_label(truth, frame.depth.width_px, patch);
    if (id == 0) continue;
    totals.patch_nees.push_back(nees(patch.theta - true_plane(id).theta(), patch.information));
  }
}

/// Share of labelled pixels, and of those how many lie within 3 sigma of their plane.
void count_coverage(const DepthFrame& frame, const PatchSet& set,
                    std::span<const std::uint16_t> found, Totals& totals) {
  for (int v = 0; v < frame.depth.height_px; ++v) {
    for (int u = 0; u < frame.depth.width_px; ++u) {
      const std::uint16_t raw = frame.depth.at(u, v);
      if (raw == 0 || raw == 65535) continue;
      totals.valid += 1;
      const std::uint16_t label = found[static_cast<std::size_t>(v * frame.depth.width_px + u)];
      if (label == 0) continue;
      totals.labelled += 1;
      const double w = 1.0 / (raw * frame.metres_per_unit);
      const double residual = w - set.planes[label - 1U].theta.dot(frame.camera.ray(u, v));
      totals.within += std::abs(residual) <= 3.0 * frame.noise.sigma_inverse_depth(w) ? 1 : 0;
    }
  }
}

void run_source(const std::string& uri, const Options& options, Totals& totals) {
  auto source = open_source(uri, {});
  if (!source) throw Failure{source.error().what};
  const auto* sim = dynamic_cast<const SimSource*>(source->get());
  Arena arena;
  PatchExtractor extractor{options.patches.config(), arena};
  Decimated decimated{options.decimate};
  std::vector<std::uint16_t> found;
  Progress progress{uri, (*source)->length()};
  for (int k = 0; options.frames == 0 || k < options.frames; ++k) {
    const auto next = (*source)->next(Deadline::never());
    if (!next) break;
    const DepthFrame frame = decimated.of(*next);
    const Timed timed;
    const PatchSet& set = extractor.run(frame, options.patches.deadline());
    totals.us.push_back(timed.cpu_us());
    totals.wall_us.push_back(timed.wall_us());
    totals.planes.push_back(static_cast<double>(set.planes.size()));
    totals.patches.push_back(static_cast<double>(set.patches.size()));
    ++totals.frames;
    found.resize(static_cast<std::size_t>(frame.depth.width_px * frame.depth.height_px));
    extractor.write_labels(frame, found);
    count_coverage(frame, set, found, totals);
    if (sim != nullptr) {
      const auto truth = decimated.labels(sim->labels(), next->depth.width_px);
      compare_with_truth(*sim, truth, frame, set, found, totals);
    }
    progress.show(static_cast<std::uint64_t>(k + 1));
  }
  progress.clear();
}

Json to_json(Totals& t) {
  const auto per_frame = [&](std::size_t n) {
    return static_cast<double>(n) / static_cast<double>(std::max<std::size_t>(1, t.frames));
  };
  Json out{{"frames", t.frames},
           {"us", {{"p50", quantile(t.us, 0.5)}, {"p95", quantile(t.us, 0.95)}}},
           {"wall_us", {{"p50", quantile(t.wall_us, 0.5)}, {"p95", quantile(t.wall_us, 0.95)}}},
           {"planes", mean(t.planes)},
           {"patches", mean(t.patches)},
           {"coverage", t.labelled / std::max(1.0, t.valid)},
           {"within_3_sigma", t.within / std::max(1.0, t.labelled)}};
  if (t.regions == 0) return out;
  out["hoover"] = {{"regions_per_frame", per_frame(t.regions)},
                   {"correct", static_cast<double>(t.correct) / static_cast<double>(t.regions)},
                   {"over", per_frame(t.over)},
                   {"under", per_frame(t.under)},
                   {"missed", per_frame(t.missed)},
                   {"noise", per_frame(t.noise)}};
  out["angle_deg"] = {{"median", quantile(t.angle_deg, 0.5)}, {"mean", mean(t.angle_deg)}};
  out["offset_mm"] = {{"median", quantile(t.offset_mm, 0.5)}, {"mean", mean(t.offset_mm)}};
  // The median of chi-square with 3 degrees of freedom is 0.789 of its mean.
  out["nees"] = {{"planes", mean(t.plane_nees)},
                 {"planes_by_median", quantile(t.plane_nees, 0.5) / 0.789},
                 {"patches", mean(t.patch_nees)},
                 {"patches_by_median", quantile(t.patch_nees, 0.5) / 0.789}};
  return out;
}

void run(const Options& options) {
  Totals totals;
  for (const std::string& uri : options.sources) run_source(uri, options, totals);
  const Json result = to_json(totals);
  if (options.json) {
    fmt::print("{}\n", result.dump());
    return;
  }
  for (const auto& [key, value] : result.items()) fmt::print("{:<16}{}\n", key, value.dump());
}

}  // namespace

void add_patches_eval(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "patches-eval",
      "Scores plane extraction over sources: time, coverage and residuals; on sim: sources also "
      "correct, over-, under-segmented, missed and noise regions (Hoover, 80 % overlap, regions of "
      "500 pixels and more), errors of the planes and consistency of their covariance");
  command->add_option("sources", options->sources, "For example 'sim:room?seed=2&frames=20'")
      ->required()
      ->type_name("URI");
  command->add_option("--frames", options->frames, "Of each source at most; 0 = all");
  command->add_option("--decimate", options->decimate, "Keep every n-th pixel")
      ->check(CLI::IsMember({1, 2, 4}));
  options->patches.add_to(*command);
  command->add_flag("--json", options->json, "One line of JSON");
  command->callback([options] { run(*options); });
}

}  // namespace maplet::ctl
