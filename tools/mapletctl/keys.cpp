// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The keys of a team: made, given, taken away, looked at, and told to a running daemon.
#include <fmt/core.h>
#include <fmt/ranges.h>
#include <sys/stat.h>

#include <algorithm>
#include <ctime>
#include <memory>

#include "tools/keys/team.hpp"
#include "tools/mapletctl/ask.hpp"
#include "transport/security/key_folder.hpp"

namespace maplet::ctl {

namespace {

using Json = nlohmann::ordered_json;
using keys::Team;

struct Options {
  Daemon daemon;
  std::string dir = "team";
  std::string name = "mapletd team";
  std::string out;
  std::string path;
  int agent = 0;
  int days = 365;
  bool renew = false;
  bool json = false;
  std::vector<std::string> agents;
};

std::int64_t now_s() { return std::time(nullptr); }

/// What is thrown below is a line already; here it gets its exit code.
template <class Run>
auto said(Run&& run) {
  try {
    return run();
  } catch (const Failure&) {
    throw;
  } catch (const std::runtime_error& e) {
    throw Failure{e.what()};
  }
}

void print(const Options& options, const Json& json, const std::string& text) {
  fmt::print("{}\n", options.json ? json.dump() : text);
}

/// It stands in a certificate and in JSON.
bool is_a_name(const std::string& text) {
  const auto control = [](unsigned char c) { return c < 0x20 || c == 0x7f; };
  if (text.empty() || text.size() > Team::kLongestName || std::ranges::any_of(text, control)) {
    return false;
  }
  try {
    return !Json(text).dump().empty();
  } catch (const Json::type_error&) {  // no UTF-8
    return false;
  }
}

void init(const Options& options) {
  if (!is_a_name(options.name)) {
    throw Failure{fmt::format("--name: 1 to {} bytes of text", Team::kLongestName), 2};
  }
  const Team team =
      said([&] { return Team::init(options.dir, options.name, options.days, now_s()); });
  const std::string until = utc(team.validity().not_after_s);
  print(options,
        {{"team", keys::to_hex(team.id())}, {"directory", options.dir}, {"not_after", until}},
        fmt::format("team {} in {}, keys until {}: keep the folder where no robot is, and a copy "
                    "of it\nnext: mapletctl keys agent N --team {}, for each robot",
                    keys::to_hex(team.id()), options.dir, until, options.dir));
}

void agent(const Options& options) {
  const std::string folder = said([&] {
    Team team = Team::open(options.dir);
    return team.add(static_cast<std::uint16_t>(options.agent), options.out, options.days,
                    options.renew, now_s());
  });
  print(
      options, {{"agent", options.agent}, {"directory", folder}},
      fmt::format("{}: give it to agent {} alone, as its mapletd's user's, and set there\n"
                  "  [security]\n  mode = \"sealed\"   # or \"dds\", with dds.profile = \"wifi\"\n"
                  "  keys = \"/etc/mapletd/keys\"   # where the folder is",
                  folder, options.agent));
}

std::uint16_t agent_number(const std::string& text) {
  char rest = 0;
  unsigned number = 0;
  if (std::sscanf(text.c_str(), "%u%c", &number, &rest) != 1 || number > 65535) {
    throw Failure{text + ": is no agent's number (0 .. 65535)", 2};
  }
  return static_cast<std::uint16_t>(number);
}

void rotate(const Options& options) {
  std::vector<std::uint16_t> gone;
  for (const std::string& text : options.agents) gone.push_back(agent_number(text));
  std::uint32_t before = 0;
  std::uint32_t generation = 0;
  std::size_t left = 0;
  const std::string file = said([&] {
    Team team = Team::open(options.dir);
    before = team.generation();
    std::string written = team.rotate(gone, options.days, now_s());
    generation = team.generation();
    left = team.robots().size();
    return written;
  });
  print(options,
        {{"generation", generation},
         {"revoked", gone},
         {"robots", left},
         {"notice", file},
         {"again", generation == before}},
        fmt::format("{}generation {} for {} robots: {}\nnext: mapletctl keys load {}, where a "
                    "daemon runs that meets the others; it passes it on",
                    generation == before ? "revoked before, and written again: " : "", generation,
                    left, file, file));
}

void load(const Options& options) {
  const auto text = read_public(options.path);
  if (!text) throw Failure{text.error()};
  const auto notices = notices_in(*text);
  if (notices.empty()) {
    throw Failure{options.path + ": no key notice: mapletctl keys revoke and rotate write them"};
  }
  Json answer;
  for (const Bytes& notice : notices) {  // a question is one line of limited length
    answer = ask(options.daemon, {{"command", "keys"}, {"notice", notice_text(notice)}});
  }
  print(options, answer, answer["done"].get<std::string>());
}

std::string state_of(const Validity& validity) {
  switch (validity.at(now_s(), 0)) {
    case Validity::State::kGood:
      return "good";
    case Validity::State::kNotYet:
      return "not valid yet";
    case Validity::State::kExpired:
      return "expired";
  }
  return {};
}

Json dates(const Validity& validity) {
  return {{"not_before", utc(validity.not_before_s)},
          {"not_after", utc(validity.not_after_s)},
          {"state", state_of(validity)}};
}

Json json_of(const Team& team) {
  Json json{{"kind", "team"},
            {"name", team.name()},
            {"team", keys::to_hex(team.id())},
            {"generation", team.generation()}};
  json.update(dates(team.validity()));
  json["agents"] = Json::array();
  for (const Team::Robot& robot : team.robots()) {
    json["agents"].push_back(
        {{"agent", robot.agent}, {"certificate_until", utc(robot.not_after_s)}});
  }
  json["revoked"] = team.revoked();
  return json;
}

Json json_of(const KeyStanding& at) {
  const AgentKeys& keys = at.keys;
  Json json{{"kind", "agent"},
            {"agent", keys.agent},
            {"team", keys::to_hex(team_of(keys.operator_key))},
            {"generation", keys.generation}};
  json.update(dates(keys.validity));
  if (at.revoked()) {
    json["state"] = "revoked";
  } else if (at.behind()) {
    json["state"] = fmt::format("without a key of generation {}", at.told);
  }
  json["revoked"] = std::vector<std::uint16_t>(keys.revoked.begin(), keys.revoked.end());
  json["notice"] = at.told > 0 ? Json(at.told) : Json();
  return json;
}

/// A robot's folder, as its daemon would start with it.
Json look_at_folder(const std::string& path) {
  const auto keys = load_agent_keys(path);
  if (!keys) throw Failure{keys.error()};
  const auto notices = load_notices(path + "/" + kNoticeFile, *keys);
  if (!notices) throw Failure{notices.error()};
  if (const std::string line = folder_problem(path); !line.empty()) {
    fmt::print(stderr, "mapletctl: {}\n", line);
  }
  return json_of(standing(*keys, *notices));
}

Json json_of(const std::vector<Bytes>& notices, const std::string& path) {
  Json json;
  for (const Bytes& bytes : notices) {
    const auto notice = read_key_notice(bytes);
    if (!notice) throw Failure{path + ": a damaged key notice"};
    if (json.is_null()) {
      json = {{"kind", "notice"},
              {"team", keys::to_hex(notice->team)},
              {"generation", notice->generation}};
      json.update(dates(notice->validity));
      json["revoked"] = std::vector<std::uint16_t>(notice->revoked.begin(), notice->revoked.end());
      json["parts"] = notice->parts;
      json["agents"] = Json::array();
    }
    for (const auto& sealed : notice->sealed) json["agents"].push_back(sealed.agent);
  }
  return json;
}

bool exists(const std::string& path) {
  struct stat info {};
  return stat(path.c_str(), &info) == 0;
}

Json look_at(const std::string& path) {
  if (exists(path + "/" + keys::kTeamFile)) return json_of(Team::open(path));
  struct stat info {};
  if (stat(path.c_str(), &info) == 0 && S_ISDIR(info.st_mode)) return look_at_folder(path);
  const auto text = read_public(path);
  if (!text) throw Failure{text.error()};
  const auto notices = notices_in(*text);
  if (notices.empty()) throw Failure{path + ": no folder of keys, and no key notice"};
  return json_of(notices, path);
}

void show(const Options& options) {
  const std::string path = options.path.empty() ? options.dir : options.path;
  const Json json = said([&] { return look_at(path); });
  if (options.json) {
    fmt::print("{}\n", json.dump());
    return;
  }
  fmt::print("{} {}: team {}, generation {}, {}, {} .. {}\n", json["kind"].get<std::string>(),
             json.contains("agent") ? std::to_string(json["agent"].get<int>()) : path,
             json["team"].get<std::string>(), json["generation"].get<std::uint32_t>(),
             json["state"].get<std::string>(), json["not_before"].get<std::string>(),
             json["not_after"].get<std::string>());
  if (json.contains("agents")) {
    std::vector<int> numbers;
    for (const Json& one : json["agents"]) {
      numbers.push_back(one.is_object() ? one["agent"].get<int>() : one.get<int>());
    }
    fmt::print("agents    {}\n",
               numbers.empty() ? "none" : fmt::format("{}", fmt::join(numbers, ", ")));
  }
  const auto revoked = json["revoked"].get<std::vector<int>>();
  if (!revoked.empty()) fmt::print("revoked   {}\n", fmt::join(revoked, ", "));
}

Command verb(Command keys, const std::shared_ptr<Options>& options, const char* name,
             const char* help, void (*run)(const Options&)) {
  const Command sub = keys.add_command(name, help);
  sub.add_flag("--json", options->json, "the answer, as JSON");
  sub.run([options, run] { run(*options); });
  return sub;
}

void add_team(Command sub, const std::shared_ptr<Options>& options) {
  sub.add_option("--team", options->dir, "the operator's folder").type_name("DIR").show_default();
}
void add_days(Command sub, const std::shared_ptr<Options>& options) {
  sub.add_option("--days", options->days, "that the keys are good for")
      .range(1, 36500)
      .show_default();
}

}  // namespace

void add_keys(Command app) {
  const Command keys = app.add_command(
      "keys", "Keys of a team of agents: who may read and speak on the link between them");
  keys.require_command();
  keys.footer(
      "From nothing to a lost robot:\n"
      "  mapletctl keys init                 once, on the operator's computer: the folder team/\n"
      "  mapletctl keys agent 1              for each robot: team/agent-1/ goes to robot 1\n"
      "  mapletctl keys revoke 3             robot 3 is lost: the next keys, without it\n"
      "  mapletctl keys load team/newest.notice --socket SOCKET    tells any daemon of the team\n"
      "The team's folder makes members: whoever has it is the operator. docs/security.md");
  const auto options = [] { return std::make_shared<Options>(); };

  auto o = options();
  Command sub = verb(keys, o, "init", "Makes a team: the operator's folder", init);
  add_team(sub, o);
  sub.add_option("--name", o->name, "that a person knows it by").show_default();
  add_days(sub, o);

  o = options();
  sub = verb(keys, o, "agent", "Makes the folder of keys that one robot gets", agent);
  sub.add_option("N", o->agent, "the robot's number (mapletd --agent)").required().range(0, 65535);
  add_team(sub, o);
  sub.add_option("--out", o->out, "the folder to write; TEAM/agent-N where it is left out")
      .type_name("DIR");
  sub.add_option("--days", o->days, "that its certificate for DDS Security is good for")
      .range(1, 36500)
      .show_default();
  sub.add_flag("--renew", o->renew, "it had keys already, which are replaced");

  o = options();
  sub = verb(keys, o, "revoke",
             "Shuts robots out: makes the next keys for all others, and a notice that tells them; "
             "again: the notice anew",
             rotate);
  sub.add_option("N", o->agents, "the robots' numbers").required();
  add_team(sub, o);
  add_days(sub, o);

  o = options();
  sub =
      verb(keys, o, "rotate", "Makes the next keys for all, and a notice that tells them", rotate);
  add_team(sub, o);
  add_days(sub, o);

  o = options();
  sub = verb(keys, o, "load", "Tells a running daemon a notice, which it passes on to all it meets",
             load);
  sub.add_option("FILE", o->path, "newest.notice of keys revoke or rotate").required();
  add_daemon_options(sub, std::shared_ptr<Daemon>{o, &o->daemon});

  o = options();
  sub = verb(
      keys, o, "show",
      "What a team's folder, a robot's folder (with the notice in it) or a notice holds; never a "
      "secret",
      show);
  sub.add_option("PATH", o->path, "folder or file; the team's folder where it is left out");
  add_team(sub, o);
}

}  // namespace maplet::ctl
