// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/private_tmp.hpp"

#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>

namespace maplet::daemon {

std::string private_tmp_of(const std::string& path, std::string_view mounts) {
  std::error_code error;
  const std::string whole = std::filesystem::weakly_canonical(path, error).string();
  std::istringstream in{std::string{mounts}};
  for (std::string line; std::getline(in, line);) {
    std::istringstream fields{line};
    std::string skipped;
    std::string root;
    std::string at;
    fields >> skipped >> skipped >> skipped >> root >> at;
    const bool tmp = at == "/tmp" || at == "/var/tmp";
    if (tmp && root.find("/systemd-private-") != std::string::npos && whole.starts_with(at + "/"))
      return at;
  }
  return {};
}

std::string private_tmp_of(const std::string& path) {
  std::ifstream file{"/proc/self/mountinfo"};
  return private_tmp_of(path, std::string{std::istreambuf_iterator<char>{file}, {}});
}

}  // namespace maplet::daemon
