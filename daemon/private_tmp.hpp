// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace maplet::daemon {

/// /tmp or /var/tmp, where `path` lies in it and this service has one of its own (systemd's
/// PrivateTmp): what is written there nobody else finds. Empty: anybody finds it.
///
/// @param mounts  as /proc/self/mountinfo has them
[[nodiscard]] std::string private_tmp_of(const std::string& path, std::string_view mounts);
[[nodiscard]] std::string private_tmp_of(const std::string& path);

}  // namespace maplet::daemon
