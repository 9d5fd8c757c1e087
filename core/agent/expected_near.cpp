// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>

#include "core/agent/agent.hpp"

namespace maplet {

namespace {

constexpr std::size_t kOwn = 32;   // of our maplets, evenly over the path
constexpr std::size_t kMost = 64;  // maplets told
constexpr double kReach_m = 10.0;  // further apart two maplets hardly overlap

}  // namespace

std::size_t Agent::expected_near(std::span<MapletKey> out) const noexcept {
  const auto own = [&](const MapletKey& key) {
    return key.agent == identity_.agent && key.epoch == identity_.epoch;
  };
  const int nodes = skeleton_.node_count();
  int own_count = 0;
  for (int i = 0; i < nodes; ++i) own_count += own(skeleton_.node(i).key) ? 1 : 0;
  const int every = std::max(1, own_count / static_cast<int>(kOwn));
  StaticVector<Skeleton::NodeView, kOwn> ours;
  for (int i = 0, k = 0; i < nodes && !full(ours); ++i) {
    if (own(skeleton_.node(i).key) && k++ % every == 0) ours.push_back(skeleton_.node(i));
  }
  StaticVector<std::pair<double, MapletKey>, kMost> nearest;  // sorted
  for (int i = 0; i < nodes; ++i) {
    const Skeleton::NodeView node = skeleton_.node(i);
    if (own(node.key) || encounters_.holds(node.key)) continue;
    double distance_m = kReach_m;
    for (const Skeleton::NodeView& mine : ours) {
      if (mine.gauge != node.gauge) continue;
      distance_m = std::min(distance_m, (mine.T_world_maplet.t - node.T_world_maplet.t).norm());
    }
    if (distance_m >= kReach_m || (full(nearest) && distance_m >= nearest.back().first)) continue;
    if (full(nearest)) nearest.pop_back();
    const auto at =
        std::ranges::find_if(nearest, [&](const auto& n) { return n.first > distance_m; });
    nearest.insert(at, {distance_m, node.key});
  }
  const std::size_t count = std::min(out.size(), nearest.size());
  for (std::size_t i = 0; i < count; ++i) out[i] = nearest[i].second;
  return count;
}

}  // namespace maplet
