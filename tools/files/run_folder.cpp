// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/files/run_folder.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>

#include "tools/files/maplet_file.hpp"

namespace maplet::files {
namespace {

namespace fs = std::filesystem;

[[nodiscard]] eval::Trajectory read_trajectory(const fs::path& file) {
  return fs::exists(file) ? eval::read_tum(file) : eval::Trajectory{};
}

/// From here on vertices are other agents' (docs/output.md): their own folders tell of them.
constexpr std::uint32_t kForeign = 1'000'000;

/// Own vertices and edges; other lines (FIX, comments) are of no use here.
void read_skeleton(const fs::path& file, Run& run) {
  std::ifstream in{file};
  std::string line;
  for (std::size_t number = 1; std::getline(in, line); ++number) {
    std::istringstream words{line};
    std::string tag;
    words >> tag;
    if (tag == "VERTEX_SE3:QUAT") {
      std::uint32_t id = 0;
      Se3 pose;
      auto& [q, t] = pose;
      words >> id >> t.x() >> t.y() >> t.z() >> q.x() >> q.y() >> q.z() >> q.w();
      if (words && std::abs(q.norm() - 1.0) < 0.01) {
        q.normalize();
        if (id < kForeign) run.nodes[id] = pose;
        continue;
      }
    } else if (tag == "EDGE_SE3:QUAT") {
      RunEdge edge;
      words >> edge.a >> edge.b;
      if (words) {
        if (edge.a < kForeign && edge.b < kForeign) run.edges.push_back(edge);
        continue;
      }
    } else {
      continue;
    }
    throw std::runtime_error{fmt::format("{}:{}: no valid {} line", file.string(), number, tag)};
  }
}

/// The NNNN of NNNN.maplet.
[[nodiscard]] std::optional<std::uint32_t> id_of(const fs::path& file) {
  const std::string stem = file.stem().string();
  std::uint32_t id = 0;
  const auto [end, error] = std::from_chars(stem.data(), stem.data() + stem.size(), id);
  if (error != std::errc{} || end != stem.data() + stem.size()) return {};
  return id;
}

void read_maplets(const fs::path& folder, Run& run) {
  if (!fs::is_directory(folder)) return;
  std::map<std::uint32_t, fs::path> files;
  for (const auto& entry : fs::directory_iterator{folder}) {
    if (entry.path().extension() != ".maplet") continue;
    if (const auto id = id_of(entry.path())) files[*id] = entry.path();
  }
  double bytes = 0.0;
  for (const auto& [id, file] : files) {
    bytes += static_cast<double>(fs::file_size(file));
    const auto node = run.nodes.find(id);
    if (node == run.nodes.end()) {
      ++run.unplaced;
      continue;
    }
    run.maplets.push_back(
        {id, Transform<WorldFrame, MapletFrame>{node->second}, surfaces_of(*read_maplet(file))});
  }
  if (!files.empty()) run.counts.maplet_bytes = bytes;
}

template <class T>
[[nodiscard]] std::optional<T> number_at(const nlohmann::json& report, const char* pointer) {
  const nlohmann::json::json_pointer at{pointer};
  if (!report.contains(at) || !report.at(at).is_number()) return {};
  return report.at(at).get<T>();
}

void read_counts(const fs::path& file, RunCounts& counts) {
  if (!fs::exists(file)) return;
  std::ifstream in{file};
  const nlohmann::json report = nlohmann::json::parse(in, nullptr, false);
  if (report.is_discarded()) throw std::runtime_error{fmt::format("{}: no JSON", file.string())};
  counts.frames = number_at<std::uint64_t>(report, "/frames/processed");
  const auto count = number_at<double>(report, "/maplets/count");
  const auto mean = number_at<double>(report, "/maplets/point_cloud_bytes_mean");
  if (count && mean) counts.point_cloud_bytes = *count * *mean;
}

/// Both start at one pose, so that what lies between them later is drift. A world that came with
/// another agent's map is not the frame that tracking started in.
void start_together(const eval::Trajectory& trajectory, eval::Trajectory& odometry) {
  if (trajectory.empty()) return;
  const auto& [stamp, pose] = trajectory.front();
  const auto same = std::ranges::find(odometry, stamp, &eval::StampedPose::stamp);
  if (same == odometry.end()) return;
  const Se3 T_world_odom = pose * same->pose.inverse();
  for (eval::StampedPose& p : odometry) p.pose = T_world_odom * p.pose;
}

}  // namespace

Run read_run(const fs::path& folder) {
  const fs::path skeleton = folder / "skeleton.g2o";
  if (!fs::exists(skeleton) && !fs::exists(folder / "trajectory.tum")) {
    throw std::runtime_error{
        fmt::format("{} holds neither skeleton.g2o nor trajectory.tum: give a folder that mapletd "
                    "--out wrote",
                    folder.string())};
  }
  Run run;
  run.name = fs::canonical(folder).filename().string();
  run.odometry = read_trajectory(folder / "odometry.tum");
  run.trajectory = read_trajectory(folder / "trajectory.tum");
  start_together(run.trajectory, run.odometry);
  read_skeleton(skeleton, run);
  read_maplets(folder / "maplets", run);
  read_counts(folder / "report.json", run.counts);
  return run;
}

std::map<std::uint32_t, Se3> read_nodes(const fs::path& folder) {
  Run run;
  read_skeleton(folder / "skeleton.g2o", run);
  return std::move(run.nodes);
}

}  // namespace maplet::files
