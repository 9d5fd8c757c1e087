// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <map>
#include <thread>

#include "tools/swarm/swarm.hpp"

namespace maplet::swarm {

namespace {

/// What two skeletons are compared by, whatever order records came in.
struct Outcome {
  std::map<MapletKey, Eigen::Vector3d> places;
  std::map<std::pair<MapletKey, MapletKey>, ClosureState> verdicts;
};

Outcome outcome_of(const Skeleton& skeleton) {
  Outcome outcome;
  for (int i = 0; i < skeleton.node_count(); ++i) {
    const auto node = skeleton.node(i);
    outcome.places[node.key] = node.T_world_maplet.t;
  }
  for (int i = 0; i < skeleton.factor_count(); ++i) {
    const auto factor = skeleton.factor(i);
    outcome.verdicts[{factor.a, factor.b}] = factor.verdict;
  }
  return outcome;
}

void compare(const Outcome& first, const Outcome& other, Solved& solved) {
  solved.same_verdicts = other.verdicts == first.verdicts;
  for (const auto& [key, place] : first.places) {
    const auto found = other.places.find(key);
    const double apart_m = found == other.places.end() ? INFINITY : (found->second - place).norm();
    solved.apart_m = std::max(solved.apart_m, apart_m);
  }
  if (other.places.size() != first.places.size()) solved.apart_m = INFINITY;
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
  solved.maplets = skeleton.node_count();
  solved.overflows = skeleton.counters().overflows;
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
  for (std::size_t i = 1; i < all.size(); ++i)
    compare(outcome_of(*skeletons[0]), outcome_of(*skeletons[i]), all[i]);
  return all;
}

}  // namespace maplet::swarm
