// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <span>
#include <vector>

#include "core/maplet/codec.hpp"
#include "tools/files/maplet_file.hpp"
#include "tools/files/ply.hpp"
#include "tools/files/run_folder.hpp"
#include "tools/mapletctl/command.hpp"

namespace maplet::ctl {
namespace {

namespace fs = std::filesystem;

struct Options {
  std::string input;
  std::string ply, g2o, tum, maplet;
  int max_bytes = kMaxMapletBytes;
  double fidelity = 1.0;
};

/// The largest of them, so many that they make up that share of the area.
std::span<const files::Surface> largest(const std::vector<files::Surface>& surfaces, double share) {
  double whole = 0.0;
  for (const files::Surface& s : surfaces) whole += s.area_m2;
  std::size_t count = 0;
  for (double shown = 0.0; count < surfaces.size() && shown < share * whole; ++count)
    shown += surfaces[count].area_m2;
  return std::span{surfaces}.first(count);
}

void export_ply(const Options& options) {
  files::PlyMesh mesh;
  if (fs::is_directory(options.input)) {
    const files::Run run = files::read_run(options.input);
    if (run.maplets.empty()) {
      throw Failure{
          fmt::format("{} has no maplets that its skeleton.g2o knows the place of", options.input)};
    }
    for (const files::RunMaplet& m : run.maplets) {
      for (const files::Surface& surface : largest(m.surfaces, options.fidelity)) {
        mesh.add(files::moved(m.T_world_maplet.se3, surface), files::colour_of(m.id, surface));
      }
    }
  } else {
    const auto maplet = files::read_maplet(options.input);
    const auto surfaces = files::surfaces_of(*maplet);
    for (const files::Surface& surface : largest(surfaces, options.fidelity)) {
      mesh.add(surface, files::colour_of(maplet->key.id, surface));
    }
  }
  mesh.write(options.ply);
}

std::string tum_line(Stamp stamp, const Se3& T) {
  const auto ns = stamp.count();
  return fmt::format("{}.{:09d} {:.6f} {:.6f} {:.6f} {:.7f} {:.7f} {:.7f} {:.7f}\n",
                     ns / 1'000'000'000, std::abs(ns % 1'000'000'000), T.t.x(), T.t.y(), T.t.z(),
                     T.q.x(), T.q.y(), T.q.z(), T.q.w());
}

void write_text(const std::string& file, const std::string& text) {
  std::ofstream out{file, std::ios::binary};
  out << text;
  out.close();
  if (!out) throw Failure{fmt::format("cannot write {}", file)};
}

void copy_of_run(const Options& options, const char* name, const std::string& to) {
  const fs::path from = fs::path{options.input} / name;
  std::ifstream in{from, std::ios::binary};
  if (!in)
    throw Failure{fmt::format("{} is not there: give a folder of mapletd --out", from.string())};
  write_text(to, {std::istreambuf_iterator<char>{in}, {}});
}

// The maplet as it travels: its first layers, as many as fit.
void export_maplet(const Options& options) {
  const std::vector<std::byte> bytes = files::read_bytes(options.input);
  (void)files::read_maplet(options.input);  // whole: a damaged one is not passed on
  const std::size_t kept = layers_within(bytes, static_cast<std::size_t>(options.max_bytes));
  if (kept == 0) {
    throw Failure{fmt::format("{}: its first layer is {} bytes; give --max-bytes that many",
                              options.input, layer_ends(bytes).front())};
  }
  const auto* text = reinterpret_cast<const char*>(bytes.data());
  write_text(options.maplet, {text, text + kept});
}

void run(const Options& options) {
  if (options.ply.empty() && options.g2o.empty() && options.tum.empty() && options.maplet.empty()) {
    throw Failure{"export: say what to write: --ply, --g2o, --tum or --maplet FILE", 2};
  }
  if (!fs::exists(options.input)) throw Failure{options.input + ": No such file or directory"};
  const bool folder = fs::is_directory(options.input);
  if (!options.maplet.empty()) {
    if (folder) throw Failure{"export --maplet needs one NNNN.maplet, not a folder", 2};
    export_maplet(options);
  }
  if (!options.ply.empty()) export_ply(options);
  if (!options.g2o.empty()) {
    if (!folder) throw Failure{"export --g2o needs a folder: one maplet has no skeleton", 2};
    copy_of_run(options, "skeleton.g2o", options.g2o);
  }
  if (options.tum.empty()) return;
  if (folder) {
    copy_of_run(options, "trajectory.tum", options.tum);
    return;
  }
  std::string text;
  const auto maplet = files::read_maplet(options.input);
  for (const MapletKeyframe& k : maplet->keyframes) {
    text += tum_line(k.stamp, k.T_maplet_camera.se3);
  }
  write_text(options.tum, text);
}

}  // namespace

void add_export(Command app) {
  auto options = std::make_shared<Options>();
  const Command command = app.add_command(
      "export", "Writes a run or a maplet for other programs: meshes, pose graphs, trajectories");
  command.add_option("input", options->input, "Folder of mapletd --out, or NNNN.maplet")
      .required()
      .type_name("DIR|FILE");
  command.add_option("--ply", options->ply, "Coloured quads: what was seen of each plane")
      .type_name("FILE");
  command
      .add_option("--fidelity", options->fidelity,
                  "Of --ply: share of each maplet's area that its largest planes make up")
      .range(0.0, 1.0);
  command.add_option("--g2o", options->g2o, "The skeleton (folders only)").type_name("FILE");
  command
      .add_option("--tum", options->tum,
                  "The camera's trajectory; of a maplet its keyframes, in its own frame")
      .type_name("FILE");
  command
      .add_option("--maplet", options->maplet,
                  "The maplet itself (one NNNN.maplet only), as coarse as --max-bytes asks")
      .type_name("FILE");
  command
      .add_option("--max-bytes", options->max_bytes,
                  "Of --maplet: as many layers as fit, coarse first (about 1, 4 and 15 KB)")
      .range(1, static_cast<int>(kMaxMapletBytes));
  command.footer(
      "Examples:\n"
      "  mapletctl export out/run --ply map.ply --g2o map.g2o --tum path.tum\n"
      "  mapletctl export out/run/maplets/0007.maplet --maplet small.maplet --max-bytes 1024");
  command.run([options] { run(*options); });
}

}  // namespace maplet::ctl
