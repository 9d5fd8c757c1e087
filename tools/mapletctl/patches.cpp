// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>

#include <Eigen/LU>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

#include "core/patches/extent.hpp"
#include "core/patches/extractor.hpp"
#include "daemon/progress.hpp"
#include "drivers/open_source.hpp"
#include "drivers/replay/image_file.hpp"
#include "tools/draw/patch_picture.hpp"
#include "tools/mapletctl/command.hpp"
#include "tools/mapletctl/decimated.hpp"
#include "tools/mapletctl/patch_options.hpp"

namespace maplet::ctl {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct Options {
  std::string source;
  std::string out;
  PatchOptions patches;
  int frames = 0;
  int decimate = 1;
  bool draw = false;
  bool json = false;
};

Json plane_to_json(std::size_t id, const PatchSet& set, std::uint32_t pixels) {
  const FramePlane& plane = set.planes[id - 1];
  const Plane p = plane.plane();
  const Eigen::Matrix3d covariance = plane.information.inverse();
  Json theta_covariance = Json::array();
  for (int k = 0; k < 9; ++k) theta_covariance.push_back(covariance(k / 3, k % 3));
  Json polygon = Json::array();
  for (const Eigen::Vector3d& corner : extent(set, id - 1)) {
    polygon.push_back({corner.x(), corner.y(), corner.z()});
  }
  Json out = {{"id", id},           {"n", {p.n.x(), p.n.y(), p.n.z()}},
              {"d", p.d},           {"area_m2", plane.area_m2},
              {"pixels", pixels},   {"rms_mm", plane.rms_m * 1e3},
              {"polygon", polygon}, {"theta_covariance", theta_covariance}};
  if (plane.mean_gray >= 0.0F) out["mean_gray"] = plane.mean_gray;
  return out;
}

/// The contract's line; ids and pixels are those of labels/.
Json frame_to_json(const DepthFrame& frame, const PatchSet& set,
                   std::span<const std::uint16_t> labels, double cpu_us, double wall_us) {
  std::vector<std::uint32_t> pixels(set.planes.size() + 1);
  for (const std::uint16_t label : labels) ++pixels[label];
  Json planes = Json::array();
  for (std::size_t p = 0; p < set.planes.size(); ++p) {
    planes.push_back(plane_to_json(p + 1, set, pixels[p + 1]));
  }
  return {{"frame", frame.index},
          {"stop", std::string{to_string(set.stop)}},
          {"us", cpu_us},
          {"wall_us", wall_us},
          {"patches", set.patches.size()},
          {"planes", planes}};
}

void make_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    throw Failure{fmt::format("{}: cannot be made: {}; choose another --out", folder.string(),
                              error.message())};
  }
}

void run(const Options& options) {
  auto source = open_source(options.source, options.patches.source());
  if (!source) {
    throw Failure{source.error().what, source.error().kind == SourceError::Kind::kUsage ? 2 : 1};
  }
  const fs::path out{options.out};
  make_folder(out / "labels");
  if (options.draw) make_folder(out / "pictures");
  std::ofstream lines{out / "patches.jsonl"};
  Arena arena;
  PatchExtractor extractor{options.patches.config(), arena};
  Decimated decimated{options.decimate};
  std::vector<std::uint16_t> labels;
  Progress progress{options.source, (*source)->length()};
  std::uint64_t frames = 0;
  double cpu_us = 0.0;
  for (; options.frames == 0 || frames < static_cast<std::uint64_t>(options.frames); ++frames) {
    const auto next = (*source)->next(Deadline::never());
    if (!next) {
      if (next.error().code == ErrorCode::kEnd) break;
      throw Failure{
          fmt::format("{}: {} {}", options.source, next.error().what, (*source)->detail())};
    }
    const DepthFrame frame = decimated.of(*next);
    const Timed timed;
    const PatchSet& set = extractor.run(frame, options.patches.deadline());
    const double us = timed.cpu_us();
    const double wall_us = timed.wall_us();
    cpu_us += us;
    const int width = frame.depth.width_px;
    labels.resize(static_cast<std::size_t>(width * frame.depth.height_px));
    extractor.write_labels(frame, labels);
    const auto file = out / "labels" / fmt::format("{:06}.png", frame.index);
    const auto written = write_png(
        file, ImageView<std::uint16_t>{labels.data(), width, frame.depth.height_px, width});
    if (!written) throw Failure{std::string{view(written.error().what)}};
    const std::string line = frame_to_json(frame, set, labels, us, wall_us).dump();
    lines << line << '\n';
    if (options.json) fmt::print("{}\n", line);
    if (options.draw) {
      draw::draw_patches(
          out / "pictures" / fmt::format("{:06}.png", frame.index), frame, set, labels,
          fmt::format("frame {}   {} patches   {} planes   {:.2f} ms   {}", frame.index,
                      set.patches.size(), set.planes.size(), us * 1e-3, to_string(set.stop)));
    }
    progress.show(frames + 1);
  }
  progress.clear();
  lines.close();
  if (!lines) {
    throw Failure{
        fmt::format("{}: cannot be written; is there space?", (out / "patches.jsonl").string())};
  }
  if (!options.json) {
    fmt::print("{}: {} frames, {:.2f} ms of CPU each\n", options.out, frames,
               frames == 0 ? 0.0 : cpu_us * 1e-3 / static_cast<double>(frames));
  }
}

}  // namespace

void add_patches(Command app) {
  auto options = std::make_shared<Options>();
  const Command command = app.add_command(
      "patches",
      "Finds the planes of each frame: OUT/labels/NNNNNN.png (plane id of each pixel, 0 = none), "
      "OUT/patches.jsonl and, on request, OUT/pictures/");
  command.add_option("source", options->source, "For example tum:DIR or 'sim:room?frames=20'")
      .required()
      .type_name("URI");
  command.add_option("--out", options->out, "Folder for the results").required().type_name("DIR");
  command.add_option("--frames", options->frames, "Stop after so many; 0 = all");
  command.add_option("--decimate", options->decimate, "Keep every n-th pixel")
      .one_of({"1", "2", "4"});
  command.add_flag("--draw", options->draw, "A picture of each frame");
  command.add_flag("--json", options->json, "The lines of patches.jsonl on standard output too");
  options->patches.add_to(command);
  command.run([options] { run(*options); });
}

}  // namespace maplet::ctl
