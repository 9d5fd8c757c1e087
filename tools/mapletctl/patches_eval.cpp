// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

#include "core/patches/extractor.hpp"
#include "daemon/progress.hpp"
#include "drivers/open_source.hpp"
#include "tools/eval/patch_score.hpp"
#include "tools/mapletctl/command.hpp"
#include "tools/mapletctl/decimated.hpp"
#include "tools/mapletctl/patch_options.hpp"
#include "tools/mapletctl/patch_truth.hpp"

namespace maplet::ctl {
namespace {

using Json = nlohmann::ordered_json;
using eval::mean;
using eval::quantile;

struct Options {
  std::vector<std::string> sources;
  PatchOptions patches;
  int frames = 0;
  int decimate = 1;
  bool json = false;
};

/// Everything that is counted over the frames of all sources.
struct Totals {
  eval::PatchScore score;
  std::vector<double> us, wall_us, planes, patches;
};

void run_source(const std::string& uri, const Options& options, Totals& totals) {
  auto source = open_source(uri, options.patches.source());
  if (!source) throw Failure{source.error().what};
  const auto known = PatchTruth::of(uri, **source);
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
    found.resize(static_cast<std::size_t>(frame.depth.width_px * frame.depth.height_px));
    extractor.write_labels(frame, found);
    totals.score.add(frame, set, found);
    if (known) {
      const auto truth = decimated.labels(known->labels(*next), next->depth.width_px);
      totals.score.add_truth(frame, set, found, truth,
                             [&](std::uint16_t label) { return known->plane(label); });
    }
    progress.show(static_cast<std::uint64_t>(k + 1));
  }
  progress.clear();
}

Json to_json(const Totals& totals) {
  const eval::PatchScore& t = totals.score;
  const auto per_frame = [&](std::size_t n) {
    return static_cast<double>(n) / static_cast<double>(std::max<std::size_t>(1, t.frames));
  };
  const auto p50_p95 = [](const std::vector<double>& values) {
    return Json{{"p50", quantile(values, 0.5)}, {"p95", quantile(values, 0.95)}};
  };
  Json out{{"frames", t.frames},
           {"us", p50_p95(totals.us)},
           {"wall_us", p50_p95(totals.wall_us)},
           {"planes", mean(totals.planes)},
           {"patches", mean(totals.patches)},
           {"coverage", t.labelled / std::max(1.0, t.valid)},
           {"within_3_sigma", t.within_3_sigma / std::max(1.0, t.labelled)}};
  if (t.regions == 0) return out;
  const auto median_mean = [](const std::vector<double>& values) {
    return Json{{"median", quantile(values, 0.5)}, {"mean", mean(values)}};
  };
  out["hoover"] = {{"regions_per_frame", per_frame(t.regions)},
                   {"correct", static_cast<double>(t.correct) / static_cast<double>(t.regions)},
                   {"over", per_frame(t.over)},
                   {"under", per_frame(t.under)},
                   {"missed", per_frame(t.missed)},
                   {"noise", per_frame(t.noise)}};
  out["angle_deg"] = median_mean(t.angle_deg);
  out["offset_mm"] = median_mean(t.offset_mm);
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

void add_patches_eval(Command app) {
  auto options = std::make_shared<Options>();
  const Command command = app.add_command(
      "patches-eval",
      "Scores plane extraction over sources: time, coverage and residuals; where the truth is "
      "known "
      "(sim:, recordings by simulate) also correct, over-, under-segmented, missed and noise "
      "regions (Hoover, 80 % overlap, regions of "
      "500 pixels and more), errors of the planes and consistency of their covariance");
  command.add_option("sources", options->sources, "For example 'sim:room?seed=2&frames=20'")
      .required()
      .type_name("URI");
  command.add_option("--frames", options->frames, "Of each source at most; 0 = all");
  command.add_option("--decimate", options->decimate, "Keep every n-th pixel")
      .one_of({"1", "2", "4"});
  options->patches.add_to(command);
  command.add_flag("--json", options->json, "One line of JSON");
  command.run([options] { run(*options); });
}

}  // namespace maplet::ctl
