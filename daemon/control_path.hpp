// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <unistd.h>

#include <cstdlib>
#include <string>
#include <vector>

namespace maplet::daemon {

/// Folders where a daemon's control socket may be, the first choice first: systemd's, the system's,
/// the user's, the last resort. mapletctl looks in the same ones.
inline std::vector<std::string> control_folders() {
  std::vector<std::string> folders;
  if (const char* runtime = std::getenv("RUNTIME_DIRECTORY")) folders.emplace_back(runtime);
  folders.emplace_back("/run/mapletd");
  if (const char* user = std::getenv("XDG_RUNTIME_DIR")) {
    folders.push_back(std::string{user} + "/mapletd");
  }
  folders.push_back("/tmp/mapletd-" + std::to_string(getuid()));
  return folders;
}

inline std::string control_socket_name(int agent) {
  return "agent-" + std::to_string(agent) + ".sock";
}

}  // namespace maplet::daemon
