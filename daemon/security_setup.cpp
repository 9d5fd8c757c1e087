// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/security_setup.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include "transport/dds/radio_config.hpp"

namespace maplet::daemon {

namespace {

/// What DDS would say without a word that helps.
std::string dds_problem(const std::string& dir) {
  const DdsSecurityFiles files{dir};
  if (const auto key = read_private(files.private_key()); !key) return key.error();
  for (const std::string& file : files.open_files()) {
    if (access(file.c_str(), R_OK) != 0) {
      return file + ": cannot be read: mapletctl keys agent writes it";
    }
  }
  return {};
}

}  // namespace

KeyStanding SecuritySetup::standing() const {
  std::vector<Bytes> all = kept;
  all.insert(all.end(), beside.begin(), beside.end());
  return maplet::standing(keys, all);
}

tl::expected<std::optional<SecuritySetup>, std::string> open_security(
    const Config& config, std::optional<std::uint16_t> agent, const std::string& state) {
  const SecurityConfig& security = config.security;
  if (!security.on()) return std::nullopt;
  const auto failed = [](const std::string& what) {
    return tl::unexpected<std::string>{"security.keys: " + what};
  };
  const auto keys = load_agent_keys(security.keys);
  if (!keys) return failed(keys.error());
  if (const std::string what = folder_problem(security.keys); !what.empty()) return failed(what);
  if (agent && keys->agent != *agent) {
    return failed(
        fmt::format("{}/{}: are the keys of agent {}, and this is agent {}: name its own folder",
                    security.keys, kAgentKeysFile, keys->agent, *agent));
  }
  if (security.in_dds()) {
    if (const std::string what = dds_problem(security.keys); !what.empty()) return failed(what);
  }
  SecuritySetup setup{
      *keys, {}, {}, (state.empty() ? security.keys : state) + "/" + kNoticeFile, {}};
  if (!state.empty()) {
    if (std::string what = folder_problem(state); !what.empty()) setup.said.push_back(what);
  }
  const auto read = [&](const std::string& file, std::vector<Bytes>& into) -> std::string {
    auto heard = load_notices(file, *keys);
    if (!heard) return heard.error();
    into = std::move(*heard);
    return {};
  };
  const std::string beside = security.keys + "/" + kNoticeFile;
  std::string problem = read(setup.kept_in, setup.kept);
  if (problem.empty() && beside != setup.kept_in) problem = read(beside, setup.beside);
  if (!problem.empty()) return failed(problem);
  return setup;
}

}  // namespace maplet::daemon
