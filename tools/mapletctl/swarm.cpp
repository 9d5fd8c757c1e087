// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/swarm/swarm.hpp"

#include <fmt/core.h>

#include <chrono>
#include <memory>
#include <nlohmann/json.hpp>

#include "daemon/progress.hpp"
#include "tools/mapletctl/command.hpp"

namespace maplet::ctl {
namespace {

using Json = nlohmann::ordered_json;

struct Options {
  swarm::SwarmConfig swarm;
  bool json = false;
};

[[nodiscard]] std::string hex(std::uint64_t digest) { return fmt::format("{:016x}", digest); }

void explain(const swarm::SwarmConfig& config, const swarm::SwarmResult& r, double wall_s) {
  fmt::print("{} agents, {:g} minutes in {}, contacts {}, {} {:g} B/s, {:.0f} % lost\n",
             config.agents, config.minutes, config.world, config.contacts, config.profile,
             config.budget_bytes_per_s, 100.0 * config.loss);
  fmt::print("records      {} made; the mean agent held {:.1f} % when the last one was made\n",
             r.records, 100.0 * r.held_share);
  fmt::print("same records {}\n", r.converged
                                      ? fmt::format("everybody, {:.0f} s later", r.convergence_s)
                                      : fmt::format("not within {:.0f} s", r.convergence_s));
  fmt::print(
      "on the air   {:.1f} bytes an agent and new record, {:.2f} times its {:.1f}; {:.0f} % "
      "digests, "
      "requests, beacons; {:.1f} with IP, UDP and DDS\n",
      r.bytes_per_record(), r.bytes_per_record() / std::max(r.record_bytes, 1.0), r.record_bytes,
      100.0 * static_cast<double>(r.control_bytes) /
          static_cast<double>(std::max<std::uint64_t>(r.bytes, 1)),
      static_cast<double>(r.wire_bytes) /
          static_cast<double>(std::max<std::uint64_t>(r.received, 1)));
  fmt::print("memory       {:.2f} MiB an agent for the exchange, {:.1f} MiB for the skeleton\n",
             static_cast<double>(r.exchange_bytes) / 1048576.0,
             static_cast<double>(r.skeleton_bytes) / 1048576.0);
  for (const auto& s : r.solved)
    fmt::print(
        "agent {:<6} {} maplets in {} group(s), {} closures rejected, {:.2f} m off, settled in "
        "{:.2f} s\n",
        s.agent, s.maplets, s.groups, s.closures_rejected, s.error_m, s.settle_s);
  if (r.solved.size() > 1)
    fmt::print("skeletons    {}\n", r.skeletons_equal() ? "equal" : "DIFFER");
  fmt::print("took         {:.1f} s\n", wall_s);
}

[[nodiscard]] Json to_json(const swarm::SwarmConfig& config, const swarm::SwarmResult& r,
                           double wall_s) {
  Json solved = Json::array();
  for (const auto& s : r.solved)
    solved.push_back({{"agent", s.agent},
                      {"apart_m", s.apart_m},
                      {"same_verdicts", s.same_verdicts},
                      {"maplets", s.maplets},
                      {"groups", s.groups},
                      {"overflows", s.overflows},
                      {"closures_rejected", s.closures_rejected},
                      {"error_m", s.error_m},
                      {"settle_s", s.settle_s}});
  return {{"agents", config.agents},
          {"converged", r.converged},
          {"records", r.records},
          {"bytes_per_record", r.bytes_per_record()},
          {"convergence_s", r.convergence_s},
          {"memory_per_agent_bytes", r.exchange_bytes + r.skeleton_bytes},
          {"exchange_bytes", r.exchange_bytes},
          {"skeleton_bytes", r.skeleton_bytes},
          {"record_bytes", r.record_bytes},
          {"wire_bytes_per_agent", static_cast<double>(r.wire_bytes) / config.agents},
          {"control_share", static_cast<double>(r.control_bytes) /
                                static_cast<double>(std::max<std::uint64_t>(r.bytes, 1))},
          {"received", r.received},
          {"duplicates", r.duplicates},
          {"held_share", r.held_share},
          {"records_digest", hex(r.digest)},
          {"skeletons_equal", r.skeletons_equal()},
          {"solved", solved},
          {"wall_s", wall_s}};
}

void run(const Options& options) {
  const auto begin = std::chrono::steady_clock::now();
  std::unique_ptr<swarm::Swarm> swarm;
  try {
    swarm = std::make_unique<swarm::Swarm>(options.swarm);
  } catch (const std::invalid_argument& e) {
    throw Failure{e.what(), 2};
  }
  Progress progress{"swarm, simulated seconds",
                    static_cast<std::uint64_t>(60.0 * options.swarm.minutes)};
  const auto result =
      swarm->run([&](double time_s) { progress.show(static_cast<std::uint64_t>(time_s)); });
  progress.clear();
  const double wall_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  if (!options.json) explain(options.swarm, result, wall_s);
  fmt::print("{}\n", to_json(options.swarm, result, wall_s).dump());
  if (!result.converged)
    throw Failure{
        fmt::format("the agents do not hold the same records after {:g} more minutes; "
                    "more meetings, a larger budget or --most-minutes would tell more",
                    options.swarm.most_minutes)};
  if (!result.skeletons_equal()) throw Failure{"skeletons of the same records differ"};
}

}  // namespace

void add_swarm(Command app) {
  auto o = std::make_shared<Options>();
  swarm::SwarmConfig& s = o->swarm;
  const Command c = app.add_command(
      "swarm", "What many agents cost: their exchange and skeletons over simulated contacts");
  c.add_option("--agents", s.agents, "How many").show_default().range(1, 1000);
  c.add_option("--minutes", s.minutes, "Simulated, in which maplets are made")
      .show_default()
      .range(0.1, 1440.0);
  c.add_option("--world", s.world, "Where they walk; larger with more of them")
      .show_default()
      .one_of({"streets", "tunnel", "hall"});
  c.add_option("--contacts", s.contacts, "Who hears whom: random, near, all or a file")
      .show_default()
      .type_name("random|near|all|FILE");
  c.add_option("--meet-every", s.meet_every_s, "random: s from one meeting of an agent to the next")
      .show_default()
      .range(1.0, 86400.0);
  c.add_option("--meet-for", s.meet_for_s, "random: s that a meeting lasts")
      .show_default()
      .range(1.0, 86400.0);
  c.add_option("--range", s.range_m, "near: m that a radio reaches").show_default().positive();
  c.add_option("--maplet-every", s.maplet_every_s, "s from one maplet of an agent to the next")
      .show_default()
      .range(1.0, 86400.0);
  c.add_option("--speed", s.speed_mps, "m/s at which they walk").show_default().range(0.0, 100.0);
  c.add_option("--profile", s.profile, "Of the link, as dds.profile")
      .show_default()
      .one_of({"wifi", "radio"});
  c.add_option("--budget", s.budget_bytes_per_s, "IP bytes/s an agent may send")
      .show_default()
      .range(100.0, 1e9);
  c.add_option("--loss", s.loss, "Share of datagrams that a receiver loses")
      .show_default()
      .range(0.0, 0.95);
  c.add_option("--lease", s.lease_s, "s for which those who are gone are still talked to")
      .show_default()
      .range(0.0, 3600.0);
  c.add_option("--solve", s.solve, "Agents drawn by seed that compute their skeletons")
      .show_default()
      .range(0, 1000);
  c.add_option("--most-minutes", s.most_minutes, "Wait so long for all to hold the same records")
      .show_default()
      .range(0.0, 1e5);
  c.add_option("--seed", s.seed, "Another swarm").show_default();
  c.add_flag("--json", o->json, "Only the last line");
  c.footer(
      "A contacts file has a line a meeting: from_s to_s agent agent. The last line is JSON. Not\n"
      "simulated: DDS's discovery, interference of those who talk at once, maplets themselves.");
  c.run([o] { run(*o); });
}

}  // namespace maplet::ctl
