// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "daemon/journal/reader.hpp"

namespace maplet::files {

/// A mission as its store holds it, for reading only.
struct Mission {
  std::string file;
  journal::Survey survey;
  std::vector<journal::Part> parts;
  std::vector<DeltaPoseRecord> delta_poses;  ///< closures, too; of all agents
  std::vector<RangeRecord> ranges;
  std::vector<journal::Decision> decisions;
  std::vector<std::pair<MapletKey, std::vector<std::byte>>> maplets;
  std::size_t snapshot_nodes = 0;
  std::array<std::uint32_t, kStreams> own{};      ///< records that are there, by stream
  std::array<std::uint32_t, kStreams> missing{};  ///< of own ones, between the first and the last

  [[nodiscard]] Life life() const noexcept { return survey.life; }
};

/// @param path  the store, or a folder that holds one
/// @throws std::runtime_error  naming the file, when there is no mission in it
[[nodiscard]] Mission read_mission(const std::string& path);

/// maplets/, skeleton.g2o, trajectory.tum, delta_poses.jsonl and the store itself, as mapletd --out
/// writes them.
/// @throws std::runtime_error  naming the file that cannot be written
void export_mission(const Mission& mission, const std::string& folder);

}  // namespace maplet::files
