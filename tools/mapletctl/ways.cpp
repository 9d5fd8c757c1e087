// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// What a planner asks a running daemon: ways along the skeleton, the map that lies over it.
#include <fmt/core.h>

#include <cstdio>

#include "tools/mapletctl/ask.hpp"

namespace maplet::ctl {

namespace {

using Json = nlohmann::ordered_json;

struct Asked {
  Daemon daemon;
  bool json = false;
  std::string to, from;
  double fidelity = 1.0;
};

void name_place(const std::string& text, const char* agent, const char* id, Json& question) {
  unsigned numbers[2] = {};
  char rest = 0;
  const int count = std::sscanf(text.c_str(), "%u:%u%c", &numbers[0], &numbers[1], &rest);
  if (count == 2) question[id] = numbers[1];
  if (count != 2 && (std::sscanf(text.c_str(), "%u%c", &numbers[0], &rest) != 1))
    throw Failure{text + ": a place is AGENT:ID as mapletctl maplets prints it, or an AGENT", 2};
  question[agent] = numbers[0];
}

std::string name_of(const Json& key) {
  return fmt::format("{}:{:04}", key["agent"].get<int>(), key["id"].get<int>());
}

void ask_way(const Asked& asked) {
  Json question{{"command", "way"}};
  name_place(asked.to, "agent_b", "id_b", question);
  if (!asked.from.empty()) name_place(asked.from, "agent_a", "id_a", question);
  const Json way = ask(asked.daemon, question);
  if (asked.json) {
    fmt::print("{}\n", way.dump());
    return;
  }
  for (const Json& m : way["maplets"]) {
    const Json& pose = m["T_map_maplet"];
    fmt::print("{}  at {:8.3f} {:8.3f} {:8.3f} m\n", name_of(m), pose[0].get<double>(),
               pose[1].get<double>(), pose[2].get<double>());
  }
  fmt::print("{:.2f} m in the map of {}\n", way["length_m"].get<double>(), name_of(way["map"]));
}

void ask_overlay(const Asked& asked) {
  Json whole{{"maplets", 0}, {"missing", 0}, {"area_m2", 0.0}, {"left_out", 0}};
  whole["planes"] = Json::array();
  for (Json next = 0; !next.is_null();) {
    const Json part =
        ask(asked.daemon, {{"command", "overlay"}, {"fidelity", asked.fidelity}, {"first", next}});
    for (const char* sum : {"maplets", "missing", "left_out"})
      whole[sum] = whole[sum].get<int>() + part[sum].get<int>();
    whole["area_m2"] = whole["area_m2"].get<double>() + part["area_m2"].get<double>();
    for (const Json& plane : part["planes"]) whole["planes"].push_back(plane);
    next = part["next"];
  }
  if (asked.json) {
    fmt::print("{}\n", whole.dump());
    return;
  }
  for (const Json& p : whole["planes"]) {
    fmt::print("{}  n {:6.3f} {:6.3f} {:6.3f}  d {:7.3f}  {:6.2f} m2\n", name_of(p["maplet"]),
               p["n"][0].get<double>(), p["n"][1].get<double>(), p["n"][2].get<double>(),
               p["d"].get<double>(), p["area_m2"].get<double>());
  }
  fmt::print("{} planes of {} maplets, {:.1f} m2; {} maplets are not held here\n",
             whole["planes"].size(), whole["maplets"].get<int>(), whole["area_m2"].get<double>(),
             whole["missing"].get<int>());
}

}  // namespace

void add_ways(Command app) {
  auto way = std::make_shared<Asked>();
  Command sub = app.add_command("way", "The shortest way that is known to a place in the skeleton");
  sub.add_option("TO", way->to, "AGENT:ID, or AGENT: where that one was last").required();
  sub.add_option("--from", way->from, "AGENT:ID or AGENT; else where this agent is");
  add_daemon_options(sub, std::shared_ptr<Daemon>{way, &way->daemon});
  sub.add_flag("--json", way->json, "{length_m, map, maplets: [{agent, epoch, id, T_map_maplet}]}");
  sub.run([way] { ask_way(*way); });

  auto overlay = std::make_shared<Asked>();
  sub = app.add_command("overlay", "The planes of all maplets, where the skeleton puts them");
  sub.add_option("--fidelity", overlay->fidelity,
                 "Share of each maplet's area that its largest planes make up")
      .range(0.0, 1.0);
  add_daemon_options(sub, std::shared_ptr<Daemon>{overlay, &overlay->daemon});
  sub.add_flag("--json", overlay->json, "all in one object");
  sub.run([overlay] { ask_overlay(*overlay); });
}

}  // namespace maplet::ctl
