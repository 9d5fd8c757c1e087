// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Patches and odometry over a source: error against the truth and thread CPU time.
//
//   odometry_bench tum:../shared/data/rgbd/redkitchen_a [--decimate 2] [--every 3] [--set
//   key=value]
#include <fmt/core.h>
#include <time.h>

#include <CLI/CLI.hpp>
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "bench/odometry_report.hpp"
#include "core/frame/decimator.hpp"
#include "core/odometry/tracker.hpp"
#include "core/patches/extractor.hpp"
#include "drivers/open_source.hpp"
#include "drivers/sim/sim_source.hpp"
#include "tools/eval/evaluate.hpp"

namespace {

using namespace maplet;
using namespace maplet::bench;

struct Options {
  std::string source;
  std::string truth;
  std::string out;
  std::vector<std::string> set;
  int decimate = 1;
  int every = 1;
  bool verbose = false;
  int windows = 0;
  std::string errors;
  std::string nees;
  std::string plot;
  bool no_gray = false;
};

double cpu_us() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e6 * static_cast<double>(t.tv_sec) + 1e-3 * static_cast<double>(t.tv_nsec);
}

template <class Config, std::size_t N>
void apply(Config& config, const Field<Config> (&fields)[N],
           const std::vector<std::string>& assignments, std::string_view section) {
  for (const std::string& text : assignments) {
    const auto dot = text.find('.');
    const auto equals = text.find('=');
    if (text.substr(0, dot) != section) continue;
    for (const auto& field : fields) {
      if (field.key != text.substr(dot + 1, equals - dot - 1)) continue;
      const double value = std::stod(text.substr(equals + 1));
      if (auto* i = std::get_if<int Config::*>(&field.member))
        config.** i = static_cast<int>(value);
      if (auto* d = std::get_if<double Config::*>(&field.member)) config.** d = value;
      if (auto* b = std::get_if<bool Config::*>(&field.member)) config.** b = value != 0.0;
    }
  }
}

Result run(const Options& options) {
  OdometryConfig odometry;
  PatchConfig patch_config;
  apply(odometry, OdometryConfig::kFields, options.set, "odometry");
  apply(patch_config, PatchConfig::kFields, options.set, "patches");
  SourceOptions source_options;
  source_options.gray = !options.no_gray;
  auto opened = open_source(options.source, source_options);
  if (!opened) throw std::runtime_error{opened.error().what};
  Arena arena;
  PatchExtractor extractor{patch_config, arena};
  Tracker tracker{odometry, arena};
  Decimator decimate{DecimatorConfig{options.decimate}, arena};
  Result result;
  Se3 last;
  const auto* simulated = dynamic_cast<const SimSource*>(opened->get());
  for (int i = 0;; ++i) {
    auto frame = (*opened)->next(Deadline::never());
    if (!frame) break;
    if (i % options.every != 0) continue;
    const DepthFrame view = decimate.run(*frame);
    if (simulated != nullptr) {
      result.truth.push_back({view.stamp, simulated->T_world_camera().se3});
    }
    const double t0 = cpu_us();
    const PatchSet& patches = extractor.run(view, Deadline::never());
    const double t1 = cpu_us();
    const Track track = tracker.run(view, patches, Deadline::never());
    const Keyframe* keyframe =
        track.keyframe_due ? &tracker.make_keyframe(view, patches, track) : nullptr;
    const double t2 = cpu_us();
    if (keyframe != nullptr) {
      ++result.keyframes;
      const Se3 step = result.links.empty() ? Se3{} : last.inverse() * track.T_odom_camera.se3;
      result.links.push_back({step, keyframe->covariance});
      last = track.T_odom_camera.se3;
      result.known.push_back(
          {track.stamp, keyframe->id, {}, Matrix6d::Zero(), track.free_axes.size()});
    } else if (track.state == Track::State::kTracking) {
      result.known.push_back({track.stamp, track.keyframe_id, track.T_keyframe_camera.se3,
                              track.covariance, track.free_axes.size()});
    }
    result.patches_us.push_back(t1 - t0);
    result.odometry_us.push_back(t2 - t1);
    result.both_us.push_back(t2 - t0);
    result.patch_counts.push_back(static_cast<double>(patches.patches.size()));
    if (options.verbose) {
      fmt::print(
          "{:4d} patches {} planes {} in {} ov {:.2f} it {} free {} kf {} lost {} f {:.2f} sig", i,
          patches.patches.size(), patches.planes.size(), track.inliers, track.overlap,
          track.iterations, track.free_axes.size(), track.keyframe_due,
          track.state == Track::State::kLost, track.disagreement);
      for (int k = 0; k < 6; ++k) fmt::print(" {:.5f}", std::sqrt(track.covariance(k, k)));
      fmt::print("\n");
    }
    if (track.state == Track::State::kLost) continue;
    result.estimate.push_back({track.stamp, track.T_odom_camera.se3});
  }
  result.counters = tracker.counters();
  return result;
}

void report(const Options& options, Result& result) {
  if (result.truth.empty() && !options.truth.empty()) result.truth = eval::read_tum(options.truth);
  const TrackerCounters& counts = result.counters;
  fmt::print("frames {} lost {} retried {} recovered {} segments {} keyframes {} with gray {}\n",
             counts.frames, counts.lost, counts.retried, counts.recovered, counts.segments,
             result.keyframes, counts.with_gray);
  const auto cost = [](const char* name, const std::vector<double>& us) {
    fmt::print("{} cpu p50 {:.0f} us p99 {:.0f} us\n", name, percentile(us, 0.5),
               percentile(us, 0.99));
  };
  cost("patches ", result.patches_us);
  cost("odometry", result.odometry_us);
  cost("both    ", result.both_us);
  fmt::print("patches per frame p50 {:.0f}\n", percentile(result.patch_counts, 0.5));
  if (result.estimate.empty())
    throw std::runtime_error{"not one frame was tracked: no errors, and no file is written"};
  if (!options.out.empty()) {
    std::ofstream out{options.out};
    for (const auto& [stamp, pose] : result.estimate) {
      out << fmt::format("{:.6f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}\n",
                         seconds(stamp), pose.t.x(), pose.t.y(), pose.t.z(), pose.q.x(), pose.q.y(),
                         pose.q.z(), pose.q.w());
    }
  }
  if (result.truth.empty()) return;
  const auto pairs = eval::associate(result.truth, result.estimate);
  for (std::size_t i = 0, n = static_cast<std::size_t>(options.windows);
       n > 0 && i + n < pairs.size(); i += n) {
    const Se3 truth = pairs[i].truth.inverse() * pairs[i + n].truth;
    const Se3 error = truth.inverse() * (pairs[i].estimate.inverse() * pairs[i + n].estimate);
    fmt::print(
        "{:4d} error mm {:6.1f} {:6.1f} {:6.1f} deg {:5.2f}  moved mm {:6.0f} {:6.0f} {:6.0f} deg "
        "{:5.1f}\n",
        i, 1e3 * error.t.x(), 1e3 * error.t.y(), 1e3 * error.t.z(), error.angle() * 57.2958,
        1e3 * truth.t.x(), 1e3 * truth.t.y(), 1e3 * truth.t.z(), truth.angle() * 57.2958);
  }
  if (result.links.size() == result.keyframes) report_consistency(result, pairs, options.nees);
  const auto e = eval::evaluate(pairs);
  const auto errors = errors_over_time(pairs, e);
  if (!options.errors.empty()) write_errors(options.errors, errors);
  if (!options.plot.empty()) write_plot(options.plot, options.source, errors);
  fmt::print(
      "ATE {:.1f} mm (max {:.1f}), RPE frame {:.2f} mm {:.3f} deg, 1 s {:.1f} mm {:.2f} deg, path "
      "{:.2f} m, pairs {}, ATE/path {:.2f} %\n",
      1e3 * e.ate_rms_m, 1e3 * e.ate_max_m, 1e3 * e.rpe_frame.m, e.rpe_frame.deg, 1e3 * e.rpe_1s.m,
      e.rpe_1s.deg, e.path_m, e.pairs, 100.0 * e.ate_rms_m / e.path_m);
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app{"Patches and odometry over a source: errors and thread CPU time"};
  app.add_option("source", options.source, "tum:DIR, sim:WORLD?...")->required();
  app.add_option("--truth", options.truth, "TUM trajectory; default: beside a tum: recording");
  app.add_option("--out", options.out, "Writes the trajectory, TUM format");
  app.add_option("--set", options.set, "odometry.KEY=VALUE or patches.KEY=VALUE");
  app.add_option("--decimate", options.decimate, "Keeps every n-th pixel")->check(CLI::Range(1, 4));
  app.add_option("--every", options.every, "Keeps every n-th frame")->check(CLI::Range(1, 1000));
  app.add_flag("--no-gray", options.no_gray, "Depth alone");
  app.add_option("--plot", options.plot, "Draws the error over time, SVG");
  app.add_option("--errors", options.errors, "Writes the error over time, CSV");
  app.add_option("--nees", options.nees, "Writes the NEES of each increment of a second, CSV");
  app.add_flag("--verbose", options.verbose, "A line per frame");
  app.add_option("--windows", options.windows, "Prints the error over every so many frames");
  CLI11_PARSE(app, argc, argv);
  if (options.truth.empty() && options.source.rfind("tum:", 0) == 0) {
    const auto folder = options.source.substr(4, options.source.find('?') - 4);
    const auto file = std::filesystem::path{folder} / "groundtruth.txt";
    if (std::filesystem::exists(file)) options.truth = file.string();
  }
  try {
    Result result = run(options);
    report(options, result);
  } catch (const std::exception& e) {
    fmt::print(stderr, "odometry_bench: {}\n", e.what());
    return 1;
  }
  return 0;
}
