// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/security/key_folder.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

namespace maplet {

tl::expected<std::vector<Bytes>, std::string> load_notices(const std::string& path,
                                                           const AgentKeys& keys) {
  const auto failed = [&](const char* what) {
    return tl::unexpected<std::string>{fmt::format(
        "{0}: {1}: who is revoked is not known: put the team's newest.notice there, or its copy "
        "from another robot",
        path, what)};
  };
  struct stat info {};
  if (stat(path.c_str(), &info) != 0 && errno == ENOENT) return std::vector<Bytes>{};
  const auto text = read_public(path);
  if (!text) return tl::unexpected{text.error()};
  auto found = notices_in(*text);
  if (found.empty() || found.size() != notices_begun(*text)) return failed("damaged or cut");
  for (const Bytes& bytes : found) {
    const auto notice = read_key_notice(bytes);
    if (!notice) return failed("damaged");
    if (notice->team != team_of(keys.operator_key)) return failed("another team's, or damaged");
    if (!signed_by(keys.operator_key, bytes)) return failed("damaged: its signature does not fit");
  }
  return found;
}

bool KeyStanding::revoked() const noexcept {
  return std::ranges::find(keys.revoked, keys.agent) != keys.revoked.end();
}

KeyStanding standing(const AgentKeys& keys, std::span<const Bytes> notices) {
  KeyStanding at{keys, 0};
  for (const Bytes& bytes : notices) {
    const auto notice = read_key_notice(bytes);
    if (!notice || notice->generation < std::max(at.told, at.keys.generation)) continue;
    at.told = notice->generation;
    (void)follow(at.keys, *notice);
  }
  return at;
}

std::string folder_problem(const std::string& dir) {
  struct stat info {};
  if (stat(dir.c_str(), &info) != 0) return {};  // opening a file in it says more
  if ((info.st_mode & 022) != 0) {
    return fmt::format(
        "{0}: others may write in it (mode {1:04o}), and take a revocation away: chmod 700 {0}",
        dir, info.st_mode & 07777);
  }
  if (info.st_uid != geteuid() && info.st_uid != 0) {
    return fmt::format("{0}: belongs to {1}, who may take a revocation away: chown {2} {0}", dir,
                       user_name(info.st_uid), user_name(geteuid()));
  }
  return {};
}

}  // namespace maplet
