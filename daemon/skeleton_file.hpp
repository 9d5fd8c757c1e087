// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>

#include "core/agent/agent.hpp"
#include "daemon/output_file.hpp"

namespace maplet::daemon {

[[nodiscard]] inline bool is_own(const MapletKey& key, const AgentIdentity& self) noexcept {
  return key.agent == self.agent && key.epoch == self.epoch;
}

/// x, y, z, qx, qy, qz, qw.
[[nodiscard]] std::array<double, 7> seven(const Se3& T);

/// The seven with spaces between them.
[[nodiscard]] std::string g2o_pose(const Se3& T);

/// skeleton.g2o. Own maplets are vertices of their number; those of others begin a million higher
/// for each of their lives, in order of life.
void write_g2o(OutputFile& file, const Skeleton& skeleton, const AgentIdentity& self);

}  // namespace maplet::daemon
