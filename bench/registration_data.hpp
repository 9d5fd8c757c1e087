// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/maplet/codec.hpp"
#include "core/maplet/maplet.hpp"
#include "drivers/sim/sim_source.hpp"
#include "drivers/uri.hpp"
#include "tools/eval/trajectory.hpp"
#include "tools/files/maplet_file.hpp"

namespace maplet::bench {

/// A maplet of a run and where its origin truly is.
struct TrueMaplet {
  std::unique_ptr<Maplet> maplet;
  Se3 T_world_maplet;
  std::size_t bytes = 0;
  std::string file;
};

/// A run's maplets and its world's name: runs of one world share a frame of truth.
struct TrueRun {
  std::string folder;
  std::string source;
  std::string world;
  std::vector<TrueMaplet> maplets;
};

/// Pose at the stamp nearest to `stamp`, 25 ms off at most.
inline const Se3* pose_at(const eval::Trajectory& truth, Stamp stamp) {
  const auto after = std::lower_bound(truth.begin(), truth.end(), stamp,
                                      [](const auto& p, Stamp s) { return p.stamp < s; });
  const eval::StampedPose* best = nullptr;
  for (auto it : {after, after == truth.begin() ? after : after - 1}) {
    if (it == truth.end()) continue;
    if (best == nullptr ||
        std::abs((it->stamp - stamp).count()) < std::abs((best->stamp - stamp).count())) {
      best = &*it;
    }
  }
  if (best == nullptr || std::abs((best->stamp - stamp).count()) > 25'000'000) return nullptr;
  return &best->pose;
}

/// Truth of a source: of the simulator, or groundtruth.txt beside a recording.
inline eval::Trajectory truth_of(const std::string& source) {
  if (source.rfind("tum:", 0) == 0) {
    const auto folder = source.substr(4, source.find('?') - 4);
    return eval::read_tum(std::filesystem::path{folder} / "groundtruth.txt");
  }
  const auto uri = Uri::parse(source);
  if (!uri) throw std::runtime_error{uri.error()};
  const auto sim = open_sim(uri->path, uri->parameters);
  if (!sim) throw std::runtime_error{sim.error()};
  eval::Trajectory out;
  for (std::uint64_t i = 0; i < (*sim)->length().value_or(0); ++i) {
    out.push_back({(*sim)->stamp(i), (*sim)->pose(i).se3});
  }
  return out;
}

/// @param text  FOLDER=SOURCE: a folder of mapletd --out and the source that it was made from
inline TrueRun read_true_run(const std::string& text) {
  const auto equals = text.find('=');
  if (equals == std::string::npos) throw std::runtime_error{text + ": give FOLDER=SOURCE"};
  TrueRun run;
  run.folder = text.substr(0, equals);
  run.source = text.substr(equals + 1);
  const std::string& source = run.source;
  // The world: the source without what differs between agents.
  run.world = source.substr(0, source.find('?'));
  if (const auto seed = source.find("seed="); seed != std::string::npos) {
    run.world += "?" + source.substr(seed, source.find('&', seed) - seed);
  }
  const auto truth = truth_of(source);
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator{run.folder + "/maplets"}) {
    if (entry.path().extension() == ".maplet") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  for (const auto& file : files) {
    auto maplet = files::read_maplet(file);
    const Se3* pose = pose_at(truth, maplet->stamp);
    if (pose == nullptr) continue;
    run.maplets.push_back(
        {std::move(maplet), *pose, std::filesystem::file_size(file), file.stem().string()});
  }
  return run;
}

/// The run as a receiver has it to whom each maplet was sent within `budget` bytes. Maplets whose
/// first layer is longer are missing.
inline TrueRun within(const TrueRun& run, std::size_t budget) {
  TrueRun out;
  out.folder = run.folder;
  out.source = run.source;
  out.world = run.world;
  for (const TrueMaplet& m : run.maplets) {
    const auto bytes = files::read_bytes(run.folder + "/maplets/" + m.file + ".maplet");
    const std::size_t sent = layers_within(bytes, budget);
    auto part = std::make_unique<Maplet>();
    if (sent == 0 || !decode(std::span{bytes}.first(sent), *part)) continue;
    out.maplets.push_back({std::move(part), m.T_world_maplet, sent, m.file});
  }
  return out;
}

/// Share of the smaller maplet's area that the other one saw too, T_a_b being true.
inline double true_overlap(const Maplet& a, const Maplet& b, const Se3& T_a_b) {
  const auto area = [](const Maplet& m) {
    double sum = 0.0;
    for (const MapletPlane& p : m.planes) sum += p.area_m2;
    return sum;
  };
  const bool swapped = area(a) < area(b);
  const Maplet& small = swapped ? a : b;
  const Maplet& large = swapped ? b : a;
  const Se3 T = swapped ? T_a_b.inverse() : T_a_b;
  double seen = 0.0;
  double all = 0.0;
  for (const MapletPlane& p : small.planes) {
    const double size = small.cell_m_of(p.grid);
    for (int row = 0; row < p.grid.rows; row += 2) {
      for (int column = 0; column < p.grid.columns; column += 2) {
        if (!small.cell(p.grid, column, row)) continue;
        all += size * size;
        const Eigen::Vector3d at = T * p.basis().point((p.grid.column0 + column + 0.5) * size,
                                                       (p.grid.row0 + row + 0.5) * size);
        const Eigen::Vector3d n = T.q * p.plane.n;
        for (const MapletPlane& q : large.planes) {
          if (q.plane.n.dot(n) < 0.95 || std::abs(q.plane.distance(at)) > 0.06) continue;
          if (!large.covers(q, at)) continue;
          seen += size * size;
          break;
        }
      }
    }
  }
  return all > 0.0 ? seen / all : 0.0;
}

}  // namespace maplet::bench
