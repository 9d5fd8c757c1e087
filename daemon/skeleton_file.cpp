// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/skeleton_file.hpp"

#include <fmt/format.h>

#include <map>

namespace maplet::daemon {

std::array<double, 7> seven(const Se3& T) {
  return {T.t.x(), T.t.y(), T.t.z(), T.q.x(), T.q.y(), T.q.z(), T.q.w()};
}

std::string g2o_pose(const Se3& T) {
  const auto v = seven(T);
  return fmt::format("{} {} {} {} {} {} {}", v[0], v[1], v[2], v[3], v[4], v[5], v[6]);
}

namespace {

/// Vertices of a g2o file: own maplets have their number; those of others begin a million higher
/// for each of their lives, in order of life.
class VertexIds {
 public:
  VertexIds(const Skeleton& skeleton, const AgentIdentity& self) : self_{self} {
    for (int i = 0; i < skeleton.node_count(); ++i) {
      const MapletKey key = skeleton.node(i).key;
      if (!is_own(key, self)) first_[{key.agent, key.epoch}] = 0;
    }
    std::uint64_t next = 0;
    for (auto& [life, first] : first_) first = next += 1'000'000;
  }
  [[nodiscard]] std::uint64_t of(const MapletKey& key) const {
    return is_own(key, self_) ? key.id : first_.at({key.agent, key.epoch}) + key.id;
  }

 private:
  AgentIdentity self_;
  std::map<std::pair<std::uint16_t, std::uint32_t>, std::uint64_t> first_;
};

}  // namespace

// Its tangent is (t, q.vec) and q.vec = theta / 2 (docs/frames.md).
void write_g2o(OutputFile& file, const Skeleton& skeleton, const AgentIdentity& self) {
  const VertexIds ids{skeleton, self};
  for (int i = 0; i < skeleton.node_count(); ++i) {
    const Skeleton::NodeView node = skeleton.node(i);
    file.append(
        fmt::format("VERTEX_SE3:QUAT {} {}\n", ids.of(node.key), g2o_pose(node.T_world_maplet)));
  }
  for (int i = 0; i < skeleton.node_count(); ++i) {  // each group stands on its own
    const Skeleton::NodeView node = skeleton.node(i);
    if (node.key == node.gauge) file.append(fmt::format("FIX {}\n", ids.of(node.key)));
  }
  for (int i = 0; i < skeleton.factor_count(); ++i) {
    const Skeleton::FactorView factor = skeleton.factor(i);
    file.append(fmt::format("EDGE_SE3:QUAT {} {} {}", ids.of(factor.a), ids.of(factor.b),
                            g2o_pose(factor.T_a_b)));
    for (int row = 0; row < 6; ++row) {
      for (int column = row; column < 6; ++column) {
        const double scale = (row < 3 ? 1.0 : 2.0) * (column < 3 ? 1.0 : 2.0);
        file.append(fmt::format(" {}", scale * factor.information(row, column)));
      }
    }
    file.append("\n");
  }
}

}  // namespace maplet::daemon
