// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>

#include "daemon/progress.hpp"
#include "drivers/replay/tum_writer.hpp"
#include "drivers/sim/sim_source.hpp"
#include "drivers/uri.hpp"
#include "tools/mapletctl/command.hpp"

namespace maplet::ctl {
namespace {

using Json = nlohmann::ordered_json;

struct Options {
  std::string uri;
  std::string out;
  bool json = false;
  bool truth_only = false;
};

/// The value, or its error as a Failure.
template <class T>
T unwrap(tl::expected<T, std::string>&& result, int code = 1) {
  if (!result) throw Failure{result.error(), code};
  return std::move(*result);
}
void check(const TumWriter::Done& done) {
  if (!done) throw Failure{done.error()};
}

std::unique_ptr<SimSource> open(const std::string& text) {
  const Uri uri = unwrap(Uri::parse(text), 2);
  if (uri.scheme != "sim") {
    throw Failure{fmt::format("source '{}': simulate takes sim:WORLD; there are {}", text,
                              sim::world_names()),
                  2};
  }
  return unwrap(open_sim(uri.path, uri.parameters), 2);
}

/// The frame's planes as the camera sees them: those that some pixel's depth was read from.
Json planes_seen(const SimSource& source, const DepthFrame& frame,
                 std::vector<std::uint32_t>& pixels) {
  pixels.assign(source.planes().size() + 1, 0);
  for (const std::uint16_t id : source.labels()) ++pixels[id];
  const Se3 T_camera_world = source.T_world_camera().se3.inverse();
  Json planes = Json::array();
  for (std::size_t id = 1; id < pixels.size(); ++id) {
    if (pixels[id] == 0) continue;
    const Plane plane = T_camera_world * source.planes()[id - 1];
    planes.push_back({{"id", id},
                      {"n", {plane.n.x(), plane.n.y(), plane.n.z()}},
                      {"d", plane.d},
                      {"pixels", pixels[id]}});
  }
  return {{"frame", frame.index}, {"stamp_s", seconds(frame.stamp)}, {"planes", planes}};
}

/// groundtruth.txt alone: what `mapletd --source sim:...` is measured against.
void write_truth(const SimSource& source, TumWriter& writer) {
  for (std::uint64_t i = 0; i < source.length().value_or(0); ++i) {
    check(writer.write_pose(source.stamp(i), source.pose(i).se3));
  }
  check(writer.finish());
}

void run(const Options& options) {
  const auto source = open(options.uri);
  RecordedCamera camera;
  camera.camera = source->camera();
  camera.metres_per_unit = 0.001;
  camera.registered_to_colour = true;
  camera.rate_hz = source->options().rate_hz;
  auto writer =
      unwrap(TumWriter::create(options.out, camera, fmt::format("simulate {}", options.uri)));
  if (options.truth_only) return write_truth(*source, writer);
  const auto planes_file = std::filesystem::path{options.out} / "planes.jsonl";
  std::ofstream planes{planes_file};

  Progress progress{options.uri, source->length()};
  std::vector<std::uint32_t> pixels;
  double path_m = 0.0;
  Eigen::Vector3d before = Eigen::Vector3d::Zero();
  while (const auto frame = source->next(Deadline::never())) {
    check(writer.write(*frame));
    const Se3& pose = source->T_world_camera().se3;
    check(writer.write_pose(frame->stamp, pose));
    check(writer.write_beside("labels", {source->labels().data(), camera.camera.width_px,
                                         camera.camera.height_px, camera.camera.width_px}));
    planes << planes_seen(*source, *frame, pixels).dump() << '\n';
    if (frame->index > 0) path_m += (pose.t - before).norm();
    before = pose.t;
    progress.show(frame->index + 1);
  }
  check(writer.finish());
  planes.close();
  if (!planes) throw Failure{fmt::format("{}: cannot be written", planes_file.string())};
  progress.clear();

  const std::uint64_t frames = source->counters().read;
  if (options.json) {
    fmt::print("{}\n", Json({{"out", options.out},
                             {"frames", frames},
                             {"path_m", path_m},
                             {"planes", source->planes().size()}})
                           .dump());
  } else {
    fmt::print("{}: {} frames, {:.1f} m of path, a world of {} planes\n", options.out, frames,
               path_m, source->planes().size());
  }
}

}  // namespace

void add_simulate(Command app) {
  auto options = std::make_shared<Options>();
  const Command command =
      app.add_command("simulate",
                      "Writes a simulated recording in TUM layout with its truth: groundtruth.txt, "
                      "labels/, planes.jsonl");
  command.footer(fmt::format("Worlds: {}\nKeys of sim:WORLD?key=value&...:\n{}", sim::world_names(),
                             sim::describe_options()));
  command.add_option("uri", options->uri, "For example 'sim:room?seed=2&frames=100'")
      .required()
      .type_name("URI");
  command.add_option("--out", options->out, "Folder to write to").required().type_name("DIR");
  command.add_flag("--truth-only", options->truth_only, "Only groundtruth.txt, no images");
  command.add_flag("--json", options->json, "One line of JSON");
  command.run([options] { run(*options); });
}

}  // namespace maplet::ctl
