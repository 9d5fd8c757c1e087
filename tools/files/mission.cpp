// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/files/mission.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <set>
#include <stdexcept>

#include "core/maplet/codec.hpp"
#include "core/skeleton/skeleton.hpp"
#include "daemon/skeleton_file.hpp"
#include "daemon/state_directory.hpp"
#include "transport/exchange/json.hpp"

namespace maplet::files {

namespace {

namespace fs = std::filesystem;

class Collector final : public journal::Visitor {
 public:
  explicit Collector(Mission& mission) : mission_{mission} {}
  void take(const DeltaPoseRecord& record) noexcept override {
    mission_.delta_poses.push_back(record);
    note(record.key);
  }
  void take(const RangeRecord& record) noexcept override {
    mission_.ranges.push_back(record);
    note(record.key);
  }
  void take(const MapletKey& key, float, std::span<const std::byte> bytes) noexcept override {
    mission_.maplets.emplace_back(key, std::vector<std::byte>{bytes.begin(), bytes.end()});
    note({key.agent, key.epoch, Stream::kMaplets, key.id});
  }
  void take(const journal::Part& part) noexcept override { mission_.parts.push_back(part); }
  void take(const journal::Decision& d) noexcept override { mission_.decisions.push_back(d); }
  void take(const journal::Poses& piece) noexcept override {
    if (piece.first) mission_.snapshot_nodes = 0;
    mission_.snapshot_nodes += piece.poses.size();
  }
  void finish() {
    for (std::size_t i = 0; i < kStreams; ++i) {
      mission_.own[i] = static_cast<std::uint32_t>(own_[i].size());
      if (!own_[i].empty())
        mission_.missing[i] = mission_.survey.ends[i] - *own_[i].begin() - mission_.own[i];
    }
  }

 private:
  void note(const RecordKey& key) {
    if (Life{key.agent, key.epoch} == mission_.life())
      own_[static_cast<std::size_t>(key.stream)].insert(key.seq);
  }
  Mission& mission_;
  std::array<std::set<std::uint32_t>, kStreams> own_;
};

void write_file(const fs::path& path, std::span<const std::byte> bytes) {
  std::ofstream file{path, std::ios::binary};
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (!file) throw std::runtime_error{fmt::format("{}: cannot be written", path.string())};
}

void write_text(const fs::path& path, const std::string& text) {
  write_file(path, std::as_bytes(std::span{text}));
}

/// The skeleton of a mission, settled.
struct Solved {
  explicit Solved(const Mission& mission) {
    SkeletonConfig config;
    config.max_nodes = std::max(config.max_nodes, static_cast<int>(mission.maplets.size() + 64));
    config.max_factors =
        std::max(config.max_factors, static_cast<int>(mission.delta_poses.size() + 64));
    skeleton = arena.make<Skeleton>("skeleton", config, arena);
    const ManualClock clock;
    const Deadline now{clock, Duration{0}};
    for (const auto& [key, bytes] : mission.maplets) (void)skeleton->add(key);
    for (const DeltaPoseRecord& record : mission.delta_poses)
      (void)skeleton->add(restore(record), now);
    for (const journal::Decision& d : mission.decisions)
      (void)skeleton->decide(d.a, d.b, d.accept, now);
    (void)skeleton->settle(Deadline::never());
  }
  Arena arena;
  Arena::Owned<Skeleton> skeleton;
};

/// The keyframes where the skeleton has their maplets; each once.
std::string trajectory(const Mission& mission, const Skeleton& skeleton) {
  std::map<std::int64_t, Se3> poses;
  const auto maplet = std::make_unique<Maplet>();
  for (const auto& [key, bytes] : mission.maplets) {
    const Se3* T = skeleton.pose(key);
    if (T == nullptr || !decode(bytes, *maplet)) continue;
    for (const MapletKeyframe& k : maplet->keyframes)
      poses.emplace(k.stamp.count(), *T * k.T_maplet_camera.se3);
  }
  std::string text;
  for (const auto& [ns, T] : poses) {
    const std::int64_t us = (ns + 500) / 1000;
    text += fmt::format("{}.{:06} {}\n", us / 1000000, us % 1000000, daemon::g2o_pose(T));
  }
  return text;
}

}  // namespace

Mission read_mission(const std::string& path) {
  Mission mission;
  mission.file = fs::is_directory(path) ? (fs::path{path} / daemon::kMissionFile).string() : path;
  journal::PosixFile file;
  const auto survey = daemon::open_mission(mission.file, file);
  if (!survey) throw std::runtime_error{survey.error()};
  mission.survey = *survey;
  std::vector<std::byte> buffer(journal::kMaxTurnBytes);
  Collector collector{mission};
  journal::Reader{file, buffer}.read(*survey, collector);
  collector.finish();
  return mission;
}

void export_mission(const Mission& mission, const std::string& folder) {
  const fs::path out{folder};
  std::error_code error;
  fs::create_directories(out / "maplets", error);
  if (error) throw std::runtime_error{fmt::format("{}: {}", folder, error.message())};
  for (const auto& [key, bytes] : mission.maplets) {
    if (Life{key.agent, key.epoch} != mission.life()) continue;
    write_file(out / fmt::format("maplets/{:04}.maplet", key.id), bytes);
  }
  const Solved solved{mission};
  daemon::OutputFile g2o;
  g2o.open((out / "skeleton.g2o").c_str());
  daemon::write_g2o(g2o, *solved.skeleton, {mission.life().agent, mission.life().epoch});
  g2o.close();
  if (g2o.error() != 0)
    throw std::runtime_error{fmt::format("{}/skeleton.g2o: cannot be written", folder)};
  write_text(out / "trajectory.tum", trajectory(mission, *solved.skeleton));
  std::string lines;
  for (const DeltaPoseRecord& record : mission.delta_poses) {
    const JsonLine line = to_json(record);
    lines += std::string{line.data(), line.size()} + "\n";
  }
  write_text(out / "delta_poses.jsonl", lines);
  fs::copy_file(mission.file, out / daemon::kMissionFile, fs::copy_options::overwrite_existing,
                error);
  if (error) throw std::runtime_error{fmt::format("{}: {}", folder, error.message())};
}

}  // namespace maplet::files
