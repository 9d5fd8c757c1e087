// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// What is asked of a running daemon: status, peers, why, closure, radio.
#include <fmt/core.h>

#include <cstdio>
#include <vector>

#include "tools/mapletctl/ask.hpp"

namespace maplet::ctl {

namespace {

using Json = nlohmann::ordered_json;

std::string maplet_name(const Json& key) {
  return fmt::format("{}:{:04}", key["agent"].get<int>(), key["id"].get<int>());
}

void print_peer(const Json& peer) {
  fmt::print("agent {:<5} heard {:.1f} s ago{}  {}  {} records  loss {:.0f} %",
             peer["agent"].get<int>(), peer["heard_s_ago"].get<double>(),
             peer["ended"].get<bool>() ? " (an ended life)" : "",
             peer["in_sync"].get<bool>() ? "in sync" : "not in sync", peer["records"].get<long>(),
             100.0 * peer["loss"].get<double>());
  const Json& held = peer["held"];
  fmt::print("  held of it: {} delta-poses, {} closures, {} maplets\n",
             held["delta_poses"].get<long>(), held["closures"].get<long>(),
             held["maplets"].get<long>());
}

void print_status(const Json& s) {
  fmt::print("agent {} ({:08x}): {}, up {:.0f} s\n", s["agent"].get<int>(),
             s["epoch"].get<std::uint32_t>(), s["state"].get<std::string>(),
             s["uptime_s"].get<double>());
  fmt::print("frames    {} read, {} dropped; {}, {} lost\n", s["frames"]["read"].get<long>(),
             s["frames"]["dropped"].get<long>(),
             s["tracking"]["now"].get<bool>() ? "tracking" : "not tracking",
             s["tracking"]["lost"].get<long>());
  fmt::print("map       {} maplets, {} delta-poses, {} closures; skeleton {} nodes, {} factors{}\n",
             s["maplets"].get<long>(), s["delta_poses"].get<long>(), s["closures"].get<long>(),
             s["skeleton"]["nodes"].get<long>(), s["skeleton"]["factors"].get<long>(),
             s["skeleton"]["settled"].get<bool>() ? ", settled" : "");
  fmt::print("memory    {:.1f} MiB arena, {:.1f} MiB in all\n",
             s["memory"]["arena_bytes"].get<double>() / 1048576.0,
             s["memory"]["rss_bytes"].get<double>() / 1048576.0);
  if (s.contains("exchange")) {
    const Json& e = s["exchange"];
    fmt::print("exchange  {}, {} listeners, {} records, {} missing, {} bytes sent ({} by DDS)\n",
               !e["open"].get<bool>()    ? "waiting for the interface"
               : e["silent"].get<bool>() ? "silent"
                                         : "open",
               e["listeners"].get<long>(), e["records"].get<long>(), e["missing"].get<long>(),
               e["wire_bytes"].get<long>(), e["dds_bytes"].get<long>());
    if (e["conflicts"].get<long>() > 0) {
      fmt::print("          two devices call themselves agent {}: give each its own --agent\n",
                 e["conflicting_agent"].get<int>());
    }
  }
  for (const Json& peer : s["peers"]) print_peer(peer);
}

void print_why(const Json& why) {
  if (why.contains("peer")) print_peer(why["peer"]);
  fmt::print("{}: {}\n", why["merged"].get<bool>() ? "merged" : "not merged",
             why["reason"].get<std::string>());
}

void print_closures(const Json& closures) {
  for (const Json& c : closures) {
    fmt::print("{} <closure> {}  {:.2f} m  chi2 {:.1f}  weight {:.2f}{}\n", maplet_name(c["a"]),
               maplet_name(c["b"]), c["length_m"].get<double>(), c["chi2"].get<double>(),
               c["weight"].get<double>(), c["rejected"].get<bool>() ? "  rejected" : "");
  }
}

struct Asked {
  Daemon daemon;
  bool json = false;
};

/// A command that asks one question and prints the answer.
void add_question(CLI::App& app, const char* name, const char* help, const char* command,
                  void (*print)(const Json&)) {
  auto asked = std::make_shared<Asked>();
  auto* sub = app.add_subcommand(name, help);
  add_daemon_options(*sub, std::shared_ptr<Daemon>{asked, &asked->daemon});
  sub->add_flag("--json", asked->json, "the whole answer, as JSON");
  sub->callback([asked, command, print] {
    const Json answer = ask(asked->daemon, {{"command", command}});
    if (asked->json) {
      fmt::print("{}\n", answer.dump());
    } else {
      print(answer);
    }
  });
}

void add_why(CLI::App& app) {
  struct Why : Asked {
    int about = 0;
  };
  auto asked = std::make_shared<Why>();
  auto* sub = app.add_subcommand(
      "why", "Why another agent's map is merged with this one, or why not: heard when, held what");
  sub->add_option("AGENT", asked->about, "the other agent's number")
      ->required()
      ->check(CLI::Range(0, 65535));
  sub->add_option("--agent", asked->daemon.agent, "which daemon of this host, by its agent number")
      ->check(CLI::Range(0, 65535));
  sub->add_option("--socket", asked->daemon.socket, "its Unix socket (control.socket)");
  sub->add_flag("--json", asked->json, "the whole answer, as JSON");
  sub->callback([asked] {
    const Json answer = ask(asked->daemon, {{"command", "why"}, {"agent", asked->about}});
    if (asked->json) {
      fmt::print("{}\n", answer.dump());
    } else {
      print_why(answer);
    }
  });
}

Json maplet_of(const std::string& text, const char* agent, const char* id) {
  unsigned numbers[2] = {};
  char rest = 0;
  if (std::sscanf(text.c_str(), "%u:%u%c", &numbers[0], &numbers[1], &rest) != 2) {
    throw Failure{text + ": a maplet is AGENT:ID, as closure list prints it", 2};
  }
  return {{agent, numbers[0]}, {id, numbers[1]}};
}

void add_closure_add(CLI::App& closure) {
  struct Add : Asked {
    std::string a, b;
    std::vector<double> pose;
  };
  auto asked = std::make_shared<Add>();
  auto* sub = closure.add_subcommand(
      "add", "Says that two maplets show one place: a closure as if the agent had found it");
  sub->add_option("A", asked->a, "AGENT:ID")->required();
  sub->add_option("B", asked->b, "AGENT:ID")->required();
  sub->add_option("T_a_b", asked->pose, "x,y,z,qx,qy,qz,qw: maps b into a")
      ->required()
      ->delimiter(',')
      ->expected(7);
  add_daemon_options(*sub, std::shared_ptr<Daemon>{asked, &asked->daemon});
  sub->callback([asked] {
    Json question{{"command", "add"}, {"T_a_b", asked->pose}};
    question.update(maplet_of(asked->a, "agent_a", "id_a"));
    question.update(maplet_of(asked->b, "agent_b", "id_b"));
    const Json answer = ask(asked->daemon, question);
    fmt::print("{}\n", answer["added"].get<bool>()
                           ? "added"
                           : "sent out as a record, but it contradicts the skeleton: rejected");
  });
}

void add_radio(CLI::App& app) {
  auto asked = std::make_shared<Asked>();
  auto state = std::make_shared<std::string>();
  auto* sub = app.add_subcommand(
      "radio", "Silences the daemon on the link to other agents (it still hears), or ends that");
  sub->add_option("STATE", *state, "silent or on")
      ->required()
      ->check(CLI::IsMember({"silent", "on"}));
  add_daemon_options(*sub, std::shared_ptr<Daemon>{asked, &asked->daemon});
  sub->callback([asked, state] {
    (void)ask(asked->daemon, {{"command", "radio"}, {"state", *state}});
  });
}

}  // namespace

void add_daemon_commands(CLI::App& app) {
  add_question(app, "status", "How a running daemon is", "status", print_status);
  add_question(app, "peers", "The other agents that a running daemon hears", "peers",
               [](const Json& peers) {
                 for (const Json& peer : peers) print_peer(peer);
                 if (peers.empty()) fmt::print("nobody was heard yet\n");
               });
  auto* closure = app.add_subcommand("closure", "Places seen again: list, add");
  closure->require_subcommand(1);
  add_question(*closure, "list", "The closures in the skeleton, with residual and weight",
               "closures", print_closures);
  add_closure_add(*closure);
  add_why(app);
  add_radio(app);
}

}  // namespace maplet::ctl
