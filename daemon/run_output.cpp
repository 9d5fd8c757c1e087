// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/run_output.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <fstream>
#include <map>
#include <optional>
#include <vector>

#include "core/maplet/codec.hpp"
#include "daemon/skeleton_file.hpp"

namespace maplet::daemon {

namespace {

constexpr const char* kFramesFile = ".frames";

/// One tracked frame, relative to what the skeleton will move.
struct FrameRecord {
  std::int64_t stamp_ns;
  std::uint32_t keyframe_id;  ///< tracked against; its own when it became one
  std::uint32_t is_keyframe;
  std::array<double, 7> T_keyframe_camera;
};

Se3 from_seven(const std::array<double, 7>& v) {
  return {Eigen::Quaterniond{v[6], v[3], v[4], v[5]}, Eigen::Vector3d{v[0], v[1], v[2]}};
}

/// One line of a TUM file. No allocation.
void append_tum(OutputFile& file, Stamp stamp, const Se3& T) noexcept {
  std::array<char, 256> line;
  const auto v = seven(T);
  const std::int64_t us = (std::abs(stamp.count()) + 500) / 1000;
  const auto end = fmt::format_to_n(line.data(), line.size(),
                                    "{}{}.{:06} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}\n",
                                    stamp.count() < 0 ? "-" : "", us / 1000000, us % 1000000, v[0],
                                    v[1], v[2], v[3], v[4], v[5], v[6]);
  file.append(std::string_view{line.data(), end.size});
}

std::vector<FrameRecord> read_frames(const std::filesystem::path& path) {
  std::vector<FrameRecord> frames(
      static_cast<std::size_t>(std::filesystem::file_size(path) / sizeof(FrameRecord)));
  std::ifstream file{path, std::ios::binary};
  file.read(reinterpret_cast<char*>(frames.data()),
            static_cast<std::streamsize>(frames.size() * sizeof(FrameRecord)));
  return frames;
}

std::string maplet_name(std::uint32_t id) { return fmt::format("maplets/{:04}.maplet", id); }

/// T_world_camera of every own keyframe, by stamp: from the first maplet that holds it.
std::map<std::int64_t, Se3> keyframe_poses(const std::filesystem::path& folder,
                                           const Skeleton& skeleton, const AgentIdentity& self) {
  std::map<std::int64_t, Se3> poses;
  const auto maplet = std::make_unique<Maplet>();
  for (int i = 0; i < skeleton.node_count(); ++i) {
    const Skeleton::NodeView node = skeleton.node(i);
    if (!is_own(node.key, self)) continue;
    std::ifstream file{folder / maplet_name(node.key.id), std::ios::binary};
    const std::string bytes{std::istreambuf_iterator<char>{file}, {}};
    if (!decode(std::as_bytes(std::span{bytes}), *maplet)) continue;
    for (const MapletKeyframe& keyframe : maplet->keyframes) {
      poses.emplace(keyframe.stamp.count(), node.T_world_maplet * keyframe.T_maplet_camera.se3);
    }
  }
  return poses;
}

/// trajectory.tum: each frame beside its keyframe, where the skeleton put that one's maplet.
void write_trajectory(OutputFile& file, const std::vector<FrameRecord>& frames,
                      const std::map<std::int64_t, Se3>& keyframe_poses) {
  std::map<std::uint32_t, Se3> poses_by_id;
  for (const FrameRecord& frame : frames) {
    const auto pose = keyframe_poses.find(frame.stamp_ns);
    if (frame.is_keyframe && pose != keyframe_poses.end()) {
      poses_by_id.emplace(frame.keyframe_id, pose->second);
    }
  }
  for (const FrameRecord& frame : frames) {
    const auto pose = poses_by_id.find(frame.keyframe_id);
    if (pose == poses_by_id.end()) continue;
    append_tum(file, Stamp{frame.stamp_ns}, pose->second * from_seven(frame.T_keyframe_camera));
  }
}

/// skeleton_alone.g2o: this agent's path as it would be without closures and without the others, in
/// its own first maplet's frame: the map before a meeting.
void write_alone(OutputFile& file, const Skeleton& skeleton, const AgentIdentity& self) {
  std::map<std::uint32_t, Se3> poses;
  std::string edges;
  for (int i = 0; i < skeleton.factor_count(); ++i) {  // in order of arrival: of the path
    const Skeleton::FactorView factor = skeleton.factor(i);
    if (factor.kind != DeltaPose::Kind::kConsecutive || !is_own(factor.a, self)) continue;
    const Se3 a = poses.try_emplace(factor.a.id).first->second;
    poses[factor.b.id] = a * factor.T_a_b;
    edges +=
        fmt::format("EDGE_SE3:QUAT {} {} {}", factor.a.id, factor.b.id, g2o_pose(factor.T_a_b));
    for (int k = 0; k < 21; ++k)
      edges += k == 0 || k == 6 || k == 11 || k == 15 || k == 18 || k == 20 ? " 1" : " 0";
    edges += "\n";
  }
  for (const auto& [id, pose] : poses) {
    file.append(fmt::format("VERTEX_SE3:QUAT {} {}\n", id, g2o_pose(pose)));
  }
  file.append(edges);
}

}  // namespace

tl::expected<std::unique_ptr<RunOutput>, std::string> RunOutput::create(const std::string& folder) {
  namespace fs = std::filesystem;
  std::unique_ptr<RunOutput> output{new RunOutput{folder}};
  std::error_code error;
  fs::create_directories(output->folder_ / "maplets", error);
  if (!error && !output->lock()) {
    return tl::unexpected{fmt::format(
        "--out {}: another run is writing there; wait for it, or choose another folder", folder)};
  }
  if (!error) {
    for (const auto& entry : fs::directory_iterator{output->folder_ / "maplets", error}) {
      if (entry.path().extension() == ".maplet") fs::remove(entry.path(), error);
    }
  }
  for (const char* name : {"trajectory.tum", "skeleton.g2o", "skeleton_alone.g2o", "map.ply",
                           "map.svg", "map.png", "report.json"}) {
    if (!error) fs::remove(output->folder_ / name, error);
  }
  const bool opened = !error &&
                      output->odometry_.open((output->folder_ / "odometry.tum").c_str()) &&
                      output->delta_poses_.open((output->folder_ / "delta_poses.jsonl").c_str()) &&
                      output->digests_.open((output->folder_ / "frames.digest").c_str()) &&
                      output->frames_.open((output->folder_ / kFramesFile).c_str());
  if (!opened) {
    return tl::unexpected{
        fmt::format("--out {}: cannot be written ({}); choose a folder you may write", folder,
                    error ? error.message() : std::strerror(errno))};
  }
  return output;
}

RunOutput::~RunOutput() {
  if (lock_ >= 0) ::close(lock_);
}

bool RunOutput::lock() noexcept {
  lock_ = ::open(folder_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  return lock_ < 0 || ::flock(lock_, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK;
}

void RunOutput::note(const OutputFile& file) noexcept {
  if (error_ == 0) error_ = file.error();
}

void RunOutput::frame(std::uint64_t index, const Step& step, const FrameDigest& digest) noexcept {
  std::array<char, 96> line;
  const auto end = fmt::format_to_n(
      line.data(), line.size(), "{} {:08x} {:08x} {:08x} {:08x} {:08x}\n", index, digest.patches,
      digest.odometry, digest.maplet, digest.registration, digest.skeleton);
  digests_.append(std::string_view{line.data(), end.size});
  note(digests_);
  if (step.track.state != Track::State::kTracking) return;
  append_tum(odometry_, step.track.stamp, step.track.T_odom_camera.se3);
  const Keyframe* own = step.keyframe;
  const FrameRecord record{step.track.stamp.count(), own ? own->id : step.track.keyframe_id,
                           own != nullptr, seven(own ? Se3{} : step.track.T_keyframe_camera.se3)};
  frames_.append(std::as_bytes(std::span{&record, 1}));
  note(odometry_);
  note(frames_);
}

void RunOutput::maplet(const MapletCut& closed) noexcept {
  std::array<char, 4096> path{};
  fmt::format_to_n(path.data(), path.size() - 1, "{}/maplets/{:04}.maplet", folder_.c_str(),
                   closed.maplet.key.id);
  if (maplet_.open(path.data())) maplet_.append(closed.bytes);
  maplet_.close();
  note(maplet_);
}

void RunOutput::delta_pose(std::string_view json_line) noexcept {
  delta_poses_.append(json_line);
  delta_poses_.append("\n");
  note(delta_poses_);
}

tl::expected<void, std::string> RunOutput::finish(const Agent& agent) {
  for (OutputFile* file : {&odometry_, &delta_poses_, &digests_, &frames_}) {
    file->close();
    note(*file);
  }
  const std::filesystem::path frames_path = folder_ / kFramesFile;
  OutputFile trajectory;
  trajectory.open((folder_ / "trajectory.tum").c_str());
  write_trajectory(trajectory, read_frames(frames_path),
                   keyframe_poses(folder_, agent.skeleton(), agent.identity()));
  trajectory.close();
  note(trajectory);
  OutputFile skeleton;
  skeleton.open((folder_ / "skeleton.g2o").c_str());
  write_g2o(skeleton, agent.skeleton(), agent.identity());
  skeleton.close();
  note(skeleton);
  OutputFile alone;
  alone.open((folder_ / "skeleton_alone.g2o").c_str());
  write_alone(alone, agent.skeleton(), agent.identity());
  alone.close();
  note(alone);
  std::error_code ignored;
  std::filesystem::remove(frames_path, ignored);
  if (error_ != 0) {
    return tl::unexpected{
        fmt::format("--out {}: not everything was written ({}); make room and run "
                    "again",
                    folder_.string(), std::strerror(error_))};
  }
  return {};
}

}  // namespace maplet::daemon
