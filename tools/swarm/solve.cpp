// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <bit>
#include <chrono>
#include <map>
#include <thread>

#include "drivers/sim/random.hpp"
#include "tools/swarm/swarm.hpp"

namespace maplet::swarm {

namespace {

/// Order-free: agents number their nodes as records came.
std::uint64_t digest_of(const Skeleton& skeleton) {
  std::uint64_t digest = 0;
  for (int i = 0; i < skeleton.node_count(); ++i) {
    const auto node = skeleton.node(i);
    std::uint64_t h = hash_of(node.key) + 31 * hash_of(node.gauge);
    for (const double v : node.T_world_maplet.t) h = sim::mix(h, std::bit_cast<std::uint64_t>(v));
    for (const double v : node.T_world_maplet.q.coeffs())
      h = sim::mix(h, std::bit_cast<std::uint64_t>(v));
    digest += h;
  }
  for (int i = 0; i < skeleton.factor_count(); ++i) {
    const auto factor = skeleton.factor(i);
    digest += sim::mix(hash_of(factor.a) + 3 * hash_of(factor.b),
                       static_cast<std::uint64_t>(factor.verdict));
  }
  return digest;
}

/// Rms of a group against the truth, laid onto it as a rigid body.
double error_of(const Skeleton& skeleton, const MapletKey& gauge,
                const std::function<Se3(const MapletKey&)>& truth) {
  std::vector<Eigen::Vector3d> a, b;
  for (int i = 0; i < skeleton.node_count(); ++i) {
    const auto node = skeleton.node(i);
    if (node.gauge != gauge) continue;
    a.push_back(node.T_world_maplet.t);
    b.push_back(truth(node.key).t);
  }
  const auto columns = [](const std::vector<Eigen::Vector3d>& points) {
    Eigen::Matrix3Xd m(3, points.size());
    for (std::size_t i = 0; i < points.size(); ++i) m.col(static_cast<Eigen::Index>(i)) = points[i];
    return m;
  };
  const Eigen::Matrix3Xd from = columns(a);
  const Eigen::Matrix3Xd to = columns(b);
  const Eigen::Matrix4d T = Eigen::umeyama(from, to, false);
  const Eigen::Matrix3Xd off = (T.topRows<3>() * from.colwise().homogeneous()) - to;
  return std::sqrt(off.colwise().squaredNorm().mean());
}

Solved settle(int agent, Skeleton& skeleton, const std::function<Se3(const MapletKey&)>& truth) {
  Solved solved;
  solved.agent = agent;
  const auto begin = std::chrono::steady_clock::now();
  (void)skeleton.settle(Deadline::never());
  solved.settle_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  solved.poses_digest = digest_of(skeleton);
  solved.maplets = skeleton.node_count();
  std::map<MapletKey, int> groups;
  for (int i = 0; i < skeleton.node_count(); ++i) ++groups[skeleton.node(i).gauge];
  solved.groups = static_cast<int>(groups.size());
  for (int i = 0; i < skeleton.factor_count(); ++i)
    solved.closures_rejected += skeleton.factor(i).verdict == ClosureState::kRejected;
  const auto largest = std::ranges::max_element(
      groups, [](const auto& one, const auto& other) { return one.second < other.second; });
  if (largest != groups.end()) solved.error_m = error_of(skeleton, largest->first, truth);
  return solved;
}

}  // namespace

std::vector<Solved> solve(std::vector<std::unique_ptr<Member>>& members,
                          const std::function<Se3(const MapletKey&)>& truth) {
  std::vector<Solved> all;
  std::vector<Skeleton*> skeletons;
  for (std::size_t i = 0; i < members.size(); ++i) {
    if (members[i]->skeleton() == nullptr) continue;
    all.push_back({.agent = static_cast<int>(i) + 1});
    skeletons.push_back(members[i]->skeleton());
  }
  std::atomic<std::size_t> next = 0;
  const auto work = [&] {
    for (std::size_t i = next++; i < all.size(); i = next++)
      all[i] = settle(all[i].agent, *skeletons[i], truth);
  };
  std::vector<std::jthread> threads;
  for (unsigned k = 1; k < std::thread::hardware_concurrency(); ++k) threads.emplace_back(work);
  work();
  threads.clear();
  return all;
}

}  // namespace maplet::swarm
