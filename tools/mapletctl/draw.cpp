// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>

#include <array>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "tools/draw/plan.hpp"
#include "tools/draw/sheet.hpp"
#include "tools/files/ply.hpp"
#include "tools/files/run_folder.hpp"
#include "tools/mapletctl/command.hpp"

namespace maplet::ctl {
namespace {

namespace fs = std::filesystem;

struct Options {
  std::vector<std::string> folders;
  std::string up = "auto";
  std::string title;
  std::string out;
  bool json = false;
};

[[nodiscard]] std::optional<Eigen::Vector3d> parse_up(const std::string& text) {
  if (text == "auto") return {};
  Eigen::Vector3d up;
  int used = 0;
  if (std::sscanf(text.c_str(), "%lf,%lf,%lf%n", &up.x(), &up.y(), &up.z(), &used) != 3 ||
      static_cast<std::size_t>(used) != text.size() || !up.allFinite() || up.norm() < 1e-6) {
    throw Failure{fmt::format("--up {}: give 'auto' or a direction x,y,z in the first camera's "
                              "frame (x right, y down, z forward), such as 0,-1,0",
                              text),
                  2};
  }
  return up;
}

/// map.svg and map.png beside the first run, or the one file asked for.
[[nodiscard]] std::vector<fs::path> pictures(const Options& options) {
  if (!options.out.empty()) return {options.out};
  const fs::path folder = options.folders.front();
  return {folder / "map.svg", folder / "map.png"};
}

/// All maplets where the skeleton has put them.
[[nodiscard]] files::PlyMesh mesh_of(const std::vector<files::Run>& runs) {
  files::PlyMesh mesh;
  for (const files::Run& run : runs) {
    for (const files::RunMaplet& maplet : run.maplets) {
      for (const files::Surface& surface : maplet.surfaces) {
        const files::Surface placed = files::moved(maplet.T_world_maplet.se3, surface);
        mesh.add(placed, files::colour_of(maplet.id, placed));
      }
    }
  }
  return mesh;
}

void run(const Options& options) {
  const auto up = parse_up(options.up);
  std::vector<files::Run> runs;
  for (const std::string& folder : options.folders) runs.push_back(files::read_run(folder));
  for (const files::Run& r : runs) {
    if (r.unplaced > 0) {
      fmt::print(stderr, "mapletctl: {}: {} maplets left out, skeleton.g2o does not place them\n",
                 r.name, r.unplaced);
    }
  }
  const draw::Plan plan = draw::make_plan(runs, up);
  const std::string title =
      !options.title.empty()
          ? options.title
          : (runs.size() == 1 ? std::string{"Map"} : fmt::format("Map of {} agents", runs.size()));
  std::vector<fs::path> written = pictures(options);
  for (const fs::path& file : written) draw::draw_sheet(plan, title, file);
  if (options.out.empty()) {
    written.push_back(fs::path{options.folders.front()} / "map.ply");
    mesh_of(runs).write(written.back());
  }
  if (options.json) {
    nlohmann::ordered_json line{{"files", nlohmann::ordered_json::array()},
                                {"frames", plan.counts.frames},
                                {"maplets", plan.counts.maplets},
                                {"closures", plan.counts.closures},
                                {"path_m", plan.counts.path_m},
                                {"floor_m2", plan.counts.floor_m2}};
    for (const fs::path& file : written) line["files"].push_back(file.string());
    fmt::print("{}\n", line.dump());
  } else {
    for (const fs::path& file : written) fmt::print("{}\n", file.string());
  }
}

}  // namespace

void add_draw(Command app) {
  auto options = std::make_shared<Options>();
  const Command command =
      app.add_command("draw",
                      "Draws what mapletd --out left in a folder, seen from above: map.svg and "
                      "map.png, and map.ply "
                      "for 3-D viewers. Several folders are several agents of one world");
  command.add_option("folders", options->folders, "Folders that mapletd --out wrote")
      .required()
      .type_name("DIR");
  command
      .add_option("--up", options->up,
                  "Which way is up: 'auto' (from what was seen) or x,y,z in the first camera's "
                  "frame")
      .type_name("auto|X,Y,Z")
      .show_default();
  command.add_option("--title", options->title, "Headline; default: Map").type_name("TEXT");
  command.add_option("--out", options->out, "One picture, *.svg or *.png, instead of all files")
      .type_name("FILE");
  command.add_flag("--json", options->json, "One line of JSON: files and figures");
  command.footer(
      "Examples:\n"
      "  mapletctl draw out/run                                 the pictures once more, into the "
      "folder\n"
      "  mapletctl draw out/a out/b --out both.png              two agents of one world");
  command.run([options] { run(*options); });
}

}  // namespace maplet::ctl
