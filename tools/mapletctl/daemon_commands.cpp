// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// What is asked of a running daemon: status, peers, why, closure, maplets, set, radio.
#include <fmt/core.h>

#include <cstdio>
#include <string_view>
#include <vector>

#include "tools/mapletctl/ask.hpp"
#include "tools/mapletctl/status_text.hpp"

namespace maplet::ctl {

namespace {

using Json = nlohmann::ordered_json;

std::string maplet_name(const Json& key) {
  return fmt::format("{}:{:04}", key["agent"].get<int>(), key["id"].get<int>());
}

void print_why(const Json& why) {
  if (why.contains("peer")) print_peer(why["peer"]);
  fmt::print("{}: {}\n", why["merged"].get<bool>() ? "merged" : "not merged",
             why["reason"].get<std::string>());
}

std::string_view verdict_of(const Json& closure) {
  if (closure.value("undecided", false)) return "  undecided: others say otherwise";
  return closure["rejected"].get<bool>() ? "  rejected" : "";
}

void print_closures(const Json& closures) {
  for (const Json& c : closures) {
    fmt::print("{} <closure> {}  {:.2f} m  chi2 {:.1f}  weight {:.2f}{}\n", maplet_name(c["a"]),
               maplet_name(c["b"]), c["length_m"].get<double>(), c["chi2"].get<double>(),
               c["weight"].get<double>(), verdict_of(c));
  }
}

struct Asked {
  Daemon daemon;
  bool json = false;
};

/// A command that asks one question and prints the answer.
void add_question(Command app, const char* name, const char* help, const char* command,
                  void (*print)(const Json&)) {
  auto asked = std::make_shared<Asked>();
  const Command sub = app.add_command(name, help);
  add_daemon_options(sub, std::shared_ptr<Daemon>{asked, &asked->daemon});
  sub.add_flag("--json", asked->json, "the whole answer, as JSON");
  sub.run([asked, command, print] {
    const Json answer = ask(asked->daemon, {{"command", command}});
    if (asked->json) {
      fmt::print("{}\n", answer.dump());
    } else {
      print(answer);
    }
  });
}

void add_why(Command app) {
  struct Why : Asked {
    int about = 0;
  };
  auto asked = std::make_shared<Why>();
  const Command sub = app.add_command(
      "why", "Why another agent's map is merged with this one, or why not: heard when, held what");
  sub.add_option("AGENT", asked->about, "the other agent's number").required().range(0, 65535);
  sub.add_option("--agent", asked->daemon.agent, "which daemon of this host, by its agent number")
      .range(0, 65535);
  sub.add_option("--socket", asked->daemon.socket, "its Unix socket (control.socket)");
  sub.add_flag("--json", asked->json, "the whole answer, as JSON");
  sub.run([asked] {
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

void add_closure_add(Command closure) {
  struct Add : Asked {
    std::string a, b;
    std::vector<double> pose;
  };
  auto asked = std::make_shared<Add>();
  const Command sub = closure.add_command(
      "add", "Says that two maplets show one place: a closure as if the agent had found it");
  sub.add_option("A", asked->a, "AGENT:ID").required();
  sub.add_option("B", asked->b, "AGENT:ID").required();
  sub.add_option("T_a_b", asked->pose, "x,y,z,qx,qy,qz,qw: maps b into a").required().comma_list(7);
  add_daemon_options(sub, std::shared_ptr<Daemon>{asked, &asked->daemon});
  sub.run([asked] {
    Json question{{"command", "add"}, {"T_a_b", asked->pose}};
    question.update(maplet_of(asked->a, "agent_a", "id_a"));
    question.update(maplet_of(asked->b, "agent_b", "id_b"));
    const Json answer = ask(asked->daemon, question);
    fmt::print("{}\n", answer["added"].get<bool>()
                           ? "added"
                           : "sent out as a record, but it contradicts the skeleton: rejected");
  });
}

void add_closure_decide(Command closure, const char* name, const char* help, bool accept) {
  struct Decide : Asked {
    std::string a, b;
  };
  auto asked = std::make_shared<Decide>();
  const Command sub = closure.add_command(name, help);
  sub.add_option("A", asked->a, "AGENT:ID, as closure list prints it").required();
  sub.add_option("B", asked->b, "AGENT:ID").required();
  add_daemon_options(sub, std::shared_ptr<Daemon>{asked, &asked->daemon});
  sub.add_flag("--json", asked->json, "the answer, as JSON");
  sub.run([asked, accept] {
    Json question{{"command", "decide"}, {"accept", accept}};
    question.update(maplet_of(asked->a, "agent_a", "id_a"));
    question.update(maplet_of(asked->b, "agent_b", "id_b"));
    const Json answer = ask(asked->daemon, question);
    if (asked->json) {
      fmt::print("{}\n", answer.dump());
    } else {
      fmt::print("{} {}\n", answer["closures"].get<int>(), accept ? "restored" : "rejected");
    }
  });
}

void add_status(Command app) {
  auto asked = std::make_shared<Asked>();
  auto prometheus = std::make_shared<bool>(false);
  const Command sub = app.add_command("status", "How a running daemon is");
  add_daemon_options(sub, std::shared_ptr<Daemon>{asked, &asked->daemon});
  const Argument json = sub.add_flag("--json", asked->json, "the whole answer, as JSON");
  sub.add_flag("--prometheus", *prometheus, "as Prometheus text, for a node exporter")
      .excludes(json);
  sub.run([asked, prometheus] {
    const Json status = ask(asked->daemon, {{"command", "status"}});
    if (asked->json) {
      fmt::print("{}\n", status.dump());
    } else if (*prometheus) {
      fmt::print("{}", prometheus_text(status));
    } else {
      print_status(status);
    }
  });
}

void print_maplets(const Json& maplets) {
  for (const Json& m : maplets) {
    const Json& pose = m["T_map_maplet"];
    fmt::print("{}  in the map of {}  at {:8.3f} {:8.3f} {:8.3f} m{}\n", maplet_name(m),
               maplet_name(m["map"]), pose[0].get<double>(), pose[1].get<double>(),
               pose[2].get<double>(),
               m["bytes"].get<std::int64_t>() > 0
                   ? fmt::format("  {} bytes", m["bytes"].get<std::int64_t>())
                   : "");
  }
}

void add_peers(Command app) {
  auto asked = std::make_shared<Asked>();
  const Command sub = app.add_command(
      "peers", "The other agents that a running daemon hears; with security on, who was refused");
  add_daemon_options(sub, std::shared_ptr<Daemon>{asked, &asked->daemon});
  sub.add_flag("--json", asked->json,
               "the agents, as JSON; of who was refused status --json tells");
  sub.run([asked] {
    const Json peers = ask(asked->daemon, {{"command", "peers"}});
    if (asked->json) {
      fmt::print("{}\n", peers.dump());
      return;
    }
    for (const Json& peer : peers) print_peer(peer);
    if (peers.empty()) fmt::print("nobody was heard yet\n");
    print_security(ask(asked->daemon, {{"command", "security"}}));
  });
}

void add_set(Command app) {
  struct Set : Asked {
    std::string key, value;
  };
  auto asked = std::make_shared<Set>();
  const Command sub = app.add_command(
      "set",
      "Changes a key of a running daemon until it restarts; an unknown one names those that may");
  sub.add_option("KEY", asked->key, "as in the configuration: frame.budget_us").required();
  sub.add_option("VALUE", asked->value, "as in the configuration").required();
  add_daemon_options(sub, std::shared_ptr<Daemon>{asked, &asked->daemon});
  sub.add_flag("--json", asked->json, "the changes, as JSON");
  sub.run([asked] {
    const Json changes =
        ask(asked->daemon, {{"command", "set"}, {"key", asked->key}, {"value", asked->value}});
    if (asked->json) {
      fmt::print("{}\n", changes.dump());
      return;
    }
    for (const Json& change : changes) {
      fmt::print("{} {} -> {}\n", change["key"].get<std::string>(),
                 change["was"].get<std::string>(), change["is"].get<std::string>());
    }
    if (changes.empty()) fmt::print("{} has that value already\n", asked->key);
  });
}

void add_radio(Command app) {
  auto asked = std::make_shared<Asked>();
  auto state = std::make_shared<std::string>();
  const Command sub = app.add_command(
      "radio", "Silences the daemon on the link to other agents (it still hears), or ends that");
  sub.add_option("STATE", *state, "silent or on").required().one_of({"silent", "on"});
  add_daemon_options(sub, std::shared_ptr<Daemon>{asked, &asked->daemon});
  sub.run([asked, state] { (void)ask(asked->daemon, {{"command", "radio"}, {"state", *state}}); });
}

}  // namespace

void add_daemon_commands(Command app) {
  add_status(app);
  add_peers(app);
  const Command closure =
      app.add_command("closure", "Places seen again: list, reject, restore, add");
  closure.require_command();
  add_question(closure, "list", "The closures in the skeleton, with residual and weight",
               "closures", print_closures);
  add_closure_decide(closure, "reject",
                     "Takes the closures between two maplets out of the skeleton of this agent; "
                     "maps that only they held together come apart",
                     false);
  add_closure_decide(closure, "restore", "Lets them count again, whatever the agent thinks", true);
  add_closure_add(closure);
  add_why(app);
  add_question(app, "maplets", "The maplets in the skeleton, and where they are", "maplets",
               print_maplets);
  add_set(app);
  add_radio(app);
}

}  // namespace maplet::ctl
