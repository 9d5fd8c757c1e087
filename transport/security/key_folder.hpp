// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "transport/security/key_files.hpp"
#include "transport/security/key_notice.hpp"

namespace maplet {

/// The notices in a file, all of this robot's team and verified. One that is damaged may be the one
/// that revokes, so such a file is of no use as a whole.
/// @return empty when there is no such file; why it cannot be used
[[nodiscard]] tl::expected<std::vector<Bytes>, std::string> load_notices(const std::string& path,
                                                                         const AgentKeys& keys);

/// Where a robot stands after the operator's words.
struct KeyStanding {
  AgentKeys keys;
  std::uint32_t told = 0;  ///< generation of the newest notice; 0: there is none
  [[nodiscard]] bool revoked() const noexcept;
  /// A newer generation has begun, and no key of it is at hand.
  [[nodiscard]] bool behind() const noexcept { return told > keys.generation; }
};
/// @param notices  verified, in any order
[[nodiscard]] KeyStanding standing(const AgentKeys& keys, std::span<const Bytes> notices);

/// @return why a folder with keys, or with notices, is not safe: who may write in it may take
///   a notice away. Empty: it is
[[nodiscard]] std::string folder_problem(const std::string& dir);

}  // namespace maplet
