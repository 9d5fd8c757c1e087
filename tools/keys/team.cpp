// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/keys/team.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "transport/security/key_files.hpp"

namespace maplet::keys {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::int64_t kDay_s = 86400;
constexpr int kAuthorityDays = 20 * 365;
constexpr const char* kAuthorityFile = "ca.pem";
constexpr const char* kAuthorityKeyFile = "ca.key.pem";

[[noreturn]] void fail(const std::string& what) { throw std::runtime_error{what}; }

void write(const std::string& path, const std::string& text, int mode) {
  if (const std::string problem = write_file(path, text, mode); !problem.empty()) fail(problem);
}

std::string read(const std::string& path) {
  auto text = read_private(path);
  if (!text) fail(text.error());
  return std::move(*text);
}

std::string read_open(const std::string& path) {
  auto text = read_public(path);
  if (!text) fail(text.error());
  return std::move(*text);
}

void make_folder(const std::string& path) {
  if (mkdir(path.c_str(), 0700) != 0 && errno != EEXIST) {
    fail(fmt::format("{}: {}", path, std::strerror(errno)));
  }
}

bool exists(const std::string& path) {
  struct stat info {};
  return lstat(path.c_str(), &info) == 0;
}

template <std::size_t N>
void from_hex(const std::string& hex, std::span<std::byte, N> out) {
  if (hex.size() != 2 * N) fail("a key of another length");
  for (std::size_t i = 0; i < N; ++i) {
    std::uint8_t byte = 0;
    const char* at = hex.data() + 2 * i;
    const auto done = std::from_chars(at, at + 2, byte, 16);
    if (done.ptr != at + 2) fail("a key that is no hexadecimal number");
    out[i] = static_cast<std::byte>(byte);
  }
}

/// By a clock that may be behind this one.
Validity certificate_validity(std::int64_t now_s, int days) {
  return {now_s - kDay_s, now_s + kDay_s * days};
}

}  // namespace

std::string to_hex(std::span<const std::byte> bytes) {
  std::string hex;
  for (const std::byte byte : bytes) hex += fmt::format("{:02x}", static_cast<unsigned>(byte));
  return hex;
}

Team Team::init(const std::string& dir, const std::string& name, int days, std::int64_t now_s) {
  make_folder(dir);
  for (const char* file : {kTeamFile, kAuthorityKeyFile, kAuthorityFile, kAgentKeysFile}) {
    if (const std::string path = dir + "/" + file; exists(path)) {
      fail(path + ": is there already: its robots would not know another; name another folder");
    }
  }
  Team team;
  team.dir_ = dir;
  team.name_ = name;
  fill_random(team.operator_key_.bytes());
  fill_random(team.group_.bytes());
  team.validity_ = {now_s, now_s + kDay_s * days};
  const Authority authority = Authority::make(name, certificate_validity(now_s, kAuthorityDays));
  write(dir + "/" + kAuthorityKeyFile, authority.self().private_key, 0600);
  write(dir + "/" + kAuthorityFile, authority.self().certificate, 0644);
  team.save();
  return team;
}

Team Team::open(const std::string& dir) {
  const std::string file = dir + "/" + kTeamFile;
  struct stat info {};
  if (stat(file.c_str(), &info) != 0 && errno == ENOENT) {
    fail(file + ": there is no team here: mapletctl keys init makes one, --team DIR names another");
  }
  Team team;
  team.dir_ = dir;
  try {
    const Json json = Json::parse(read(file));
    team.name_ = json.at("name").get<std::string>();
    from_hex(json.at("operator_key").get<std::string>(), team.operator_key_.bytes());
    from_hex(json.at("group_key").get<std::string>(), team.group_.bytes());
    team.generation_ = json.at("generation").get<std::uint32_t>();
    team.validity_ = {json.at("not_before_s").get<std::int64_t>(),
                      json.at("not_after_s").get<std::int64_t>()};
    team.next_serial_ = json.at("next_serial").get<std::uint64_t>();
    for (const Json& one : json.at("robots")) {
      Robot robot{one.at("agent").get<std::uint16_t>(),
                  {},
                  one.at("serial").get<std::uint64_t>(),
                  one.at("not_after_s").get<std::int64_t>()};
      from_hex(one.at("key").get<std::string>(), std::span{robot.key});
      team.robots_.push_back(robot);
    }
    team.revoked_ = json.at("revoked").get<std::vector<std::uint16_t>>();
    team.revoked_serials_ = json.at("revoked_serials").get<std::vector<std::uint64_t>>();
  } catch (const Json::exception&) {
    fail(file + ": damaged: restore it from its copy");
  }
  return team;
}

void Team::save() const {
  Json json{{"name", name_},
            {"team", to_hex(id())},
            {"operator_key", to_hex(operator_key_.bytes())},
            {"group_key", to_hex(group_.bytes())},
            {"generation", generation_},
            {"not_before_s", validity_.not_before_s},
            {"not_after_s", validity_.not_after_s},
            {"next_serial", next_serial_},
            {"robots", Json::array()},
            {"revoked", revoked_},
            {"revoked_serials", revoked_serials_}};
  for (const Robot& robot : robots_) {
    json["robots"].push_back({{"agent", robot.agent},
                              {"key", to_hex(robot.key)},
                              {"serial", robot.serial},
                              {"not_after_s", robot.not_after_s}});
  }
  write(dir_ + "/" + kTeamFile, json.dump(2) + "\n", 0600);
}

Authority Team::authority() const {
  const std::string key = dir_ + "/" + kAuthorityKeyFile;
  constexpr const char* kRemedy = ": restore ca.key.pem and ca.pem from the folder's copy";
  if (!exists(key)) fail(key + ": is not there" + kRemedy);
  const Authority authority{{read_open(dir_ + "/" + kAuthorityFile), read(key)}};
  if (!authority.sound()) fail(key + ": damaged, or not the key of ca.pem beside it" + kRemedy);
  return authority;
}

Revoked Team::latest_revoked() const {
  Revoked latest;
  const std::size_t skip = revoked_.size() - std::min(revoked_.size(), latest.capacity());
  for (std::size_t i = skip; i < revoked_.size(); ++i) latest.push_back(revoked_[i]);
  return latest;
}

/// Looks who has a folder, before anything is written there.
/// @return whether this robot's keys are in it; whoever else's is thrown
bool Team::occupied(const std::string& folder, std::uint16_t agent, bool renew) const {
  const auto taken = [](const std::string& path, const std::string& by) {
    fail(fmt::format("{}: {}, which would be lost: name another folder with --out", path, by));
  };
  for (const char* file : {kTeamFile, kAuthorityKeyFile}) {
    if (exists(folder + "/" + file)) taken(folder + "/" + file, "a team's own file");
  }
  const std::string keys_file = folder + "/" + kAgentKeysFile;
  const bool there = exists(keys_file);
  if (there) {
    const auto keys = load_agent_keys(folder);
    if (!keys) fail(keys.error() + "; or name another folder with --out");
    if (team_of(keys->operator_key) != id()) taken(keys_file, "keys of another team");
    if (keys->agent != agent) taken(keys_file, fmt::format("the keys of agent {}", keys->agent));
    return true;
  }
  // Without agent.keys: somebody else's certificates, or the beginning of ours.
  const std::string authority = folder + "/" + kAuthorityFile;
  const bool begun =
      renew && exists(authority) && read_open(authority) == read_open(dir_ + "/" + kAuthorityFile);
  for (const char* file : {kAuthorityFile, "identity.pem", "identity.key.pem"}) {
    const std::string path = folder + "/" + file;
    if (!begun && exists(path)) taken(path, "somebody's certificate");
  }
  return false;
}

std::string Team::add(std::uint16_t agent, const std::string& out, int days, bool renew,
                      std::int64_t now_s) {
  if (std::ranges::find(revoked_, agent) != revoked_.end()) {
    fail(fmt::format("agent {} was revoked: give the robot another number", agent));
  }
  const auto had = std::ranges::find(robots_, agent, &Robot::agent);
  const std::string folder = out.empty() ? fmt::format("{}/agent-{}", dir_, agent) : out;
  const bool there = occupied(folder, agent, renew);
  if ((had != robots_.end() || there) && !renew) {
    fail(
        fmt::format("agent {} has keys already: --renew makes new ones for the same robot; for "
                    "another one choose another number",
                    agent));
  }
  AgentKeys keys;
  keys.operator_key = verifying_key(operator_key_);
  keys.agent = agent;
  keys.generation = generation_;
  keys.validity = validity_;
  fill_random(keys.own.bytes());
  keys.group = group_;
  keys.revoked = latest_revoked();
  const Validity dates = certificate_validity(now_s, days);
  const std::string name = fmt::format("agent-{}", agent);
  const Authority authority = this->authority();
  const Identity identity = authority.issue(name, next_serial_, dates);
  const std::string governance = authority.sign(governance_xml());
  const std::string permissions = authority.sign(permissions_xml(name, dates));
  const std::string revoked =
      revoked_serials_.empty() ? "" : authority.revoked(revoked_serials_, dates);
  make_folder(folder);
  if (had != robots_.end()) {
    revoked_serials_.push_back(had->serial);
    robots_.erase(had);
  }
  robots_.push_back({agent, exchange_public(keys.own), next_serial_++, dates.not_after_s});
  save();  // first: a robot whose keys nobody remembers would be left out of the next ones
  write(folder + "/" + kAuthorityFile, authority.self().certificate, 0644);
  write(folder + "/identity.key.pem", identity.private_key, 0600);
  write(folder + "/identity.pem", identity.certificate, 0644);
  write(folder + "/governance.p7s", governance, 0644);
  write(folder + "/permissions.p7s", permissions, 0644);
  if (!revoked.empty()) write(folder + "/" + kRevokedFile, revoked, 0644);
  write(folder + "/" + kAgentKeysFile, agent_keys_text(keys, operator_key_), 0600);
  return folder;
}

bool Team::remove(const std::vector<std::uint16_t>& gone) {
  bool any = false;
  for (const std::uint16_t agent : gone) {
    if (std::ranges::find(revoked_, agent) != revoked_.end()) continue;
    const auto robot = std::ranges::find(robots_, agent, &Robot::agent);
    if (robot == robots_.end()) {
      fail(fmt::format("agent {} has no keys of this team: mapletctl keys show lists who has",
                       agent));
    }
    revoked_.push_back(agent);
    revoked_serials_.push_back(robot->serial);
    robots_.erase(robot);
    any = true;
  }
  return any;
}

std::string Team::notice() const {
  KeyNotice notice;
  notice.revoked = latest_revoked();
  const std::size_t most = sealed_in_a_part(notice.revoked.size());
  const std::size_t parts = std::max<std::size_t>(1, (robots_.size() + most - 1) / most);
  if (parts > KeyNotice::kMaxParts) {
    fail(fmt::format("{} robots are more than {} that a notice reaches", robots_.size(),
                     most * KeyNotice::kMaxParts));
  }
  ExchangeKey passing;
  fill_random(passing.bytes());
  notice.team = id();
  notice.generation = generation_;
  notice.parts = static_cast<std::uint8_t>(parts);
  notice.validity = validity_;
  notice.passing = exchange_public(passing);
  std::string text;
  for (std::size_t part = 0; part < parts; ++part) {
    notice.part = static_cast<std::uint8_t>(part);
    notice.sealed.clear();
    for (std::size_t i = part * most; i < std::min((part + 1) * most, robots_.size()); ++i) {
      notice.sealed.push_back(
          seal_for(robots_[i].agent, robots_[i].key, passing, generation_, group_));
    }
    text += notice_text(to_bytes(notice, operator_key_));
  }
  return text;
}

std::string Team::rotate(const std::vector<std::uint16_t>& gone, int days, std::int64_t now_s) {
  const bool next = remove(gone) || gone.empty();
  if (next) {
    ++generation_;
    fill_random(group_.bytes());
    validity_ = {now_s, now_s + kDay_s * days};
  }
  const std::string text = notice();
  const std::string revoked =
      revoked_serials_.empty()
          ? ""
          : authority().revoked(revoked_serials_, certificate_validity(now_s, kAuthorityDays));
  if (next) save();  // before the notice: one that nobody remembers would lock its robots out
  const std::string file = dir_ + "/" + kNoticeFile;
  write(file, text, 0644);
  if (!revoked.empty()) write(dir_ + "/" + kRevokedFile, revoked, 0644);
  return file;
}

}  // namespace maplet::keys
