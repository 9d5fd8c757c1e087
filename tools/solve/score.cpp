// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/solve/score.hpp"

#include <Eigen/Geometry>
#include <cmath>

#include "tools/solve/order.hpp"

namespace maplet::graphs {
namespace {

struct Pairs {
  std::vector<Eigen::Vector3d> truth, estimate;

  void add(const Se3& t, const Se3& e) {
    truth.push_back(t.t);
    estimate.push_back(e.t);
  }
  /// The rigid motion from the estimate to the truth, without scale; planar data stays planar.
  [[nodiscard]] Eigen::Isometry3d motion(bool planar) const {
    Eigen::Isometry3d out = Eigen::Isometry3d::Identity();
    const auto n = static_cast<Eigen::Index>(truth.size());
    const Eigen::Index d = planar ? 2 : 3;
    Eigen::MatrixXd from(d, n), to(d, n);
    for (Eigen::Index i = 0; i < n; ++i) {
      from.col(i) = estimate[static_cast<std::size_t>(i)].head(d);
      to.col(i) = truth[static_cast<std::size_t>(i)].head(d);
    }
    const Eigen::MatrixXd T = Eigen::umeyama(from, to, false);
    out.matrix().topLeftCorner(d, d) = T.topLeftCorner(d, d);
    out.matrix().col(3).head(d) = T.col(d).head(d);
    return out;
  }
  [[nodiscard]] double sum_of_squares(const Eigen::Isometry3d& T) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < truth.size(); ++i)
      sum += (truth[i] - T * estimate[i]).squaredNorm();
    return sum;
  }
};

/// Each agent's odometry strung together from its first pose.
std::map<std::uint64_t, Se3> dead_reckoning(const GraphFile& file) {
  std::map<std::uint64_t, Se3> poses;
  for (const Item& item : in_time_order(file).items) {
    const Edge& e = file.edges[item.edge];
    if (!is_odometry(e)) continue;
    const bool forward = e.b == e.a + 1;
    const Se3& from = poses.try_emplace(forward ? e.a : e.b).first->second;
    poses.try_emplace(forward ? e.b : e.a, from * (forward ? e.z : e.z.inverse()));
  }
  return poses;
}

}  // namespace

std::optional<Accuracy> score(const GraphFile& file, const std::vector<Vertex>& solved) {
  Pairs all, points;
  std::map<std::uint64_t, Pairs> by_agent;
  const auto wheels = dead_reckoning(file);
  for (const Vertex& v : solved) {
    const auto truth = file.truth.find(v.id);
    if (truth == file.truth.end()) continue;
    const bool point = file.points.contains(v.id);
    (point ? points : all).add(truth->second, v.pose);
    if (const auto w = wheels.find(v.id); !point && w != wheels.end())
      by_agent[v.id >> 56].add(truth->second, w->second);
  }
  if (all.truth.size() < 3) return std::nullopt;
  Accuracy out;
  out.poses = all.truth.size();
  out.points = points.truth.size();
  const Eigen::Isometry3d T = all.motion(file.planar);
  out.ate_rms_m = std::sqrt(all.sum_of_squares(T) / static_cast<double>(out.poses));
  if (out.points > 0)
    out.points_rms_m = std::sqrt(points.sum_of_squares(T) / static_cast<double>(out.points));
  double sum = 0.0;
  std::size_t count = 0;
  for (const auto& [agent, pairs] : by_agent) {
    if (pairs.truth.size() < 3) continue;
    sum += pairs.sum_of_squares(pairs.motion(file.planar));
    count += pairs.truth.size();
  }
  if (count > 0) out.odometry_ate_rms_m = std::sqrt(sum / static_cast<double>(count));
  return out;
}

}  // namespace maplet::graphs
