// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/mapletctl/status_text.hpp"

#include <fmt/core.h>

namespace maplet::ctl {

namespace {

using Json = nlohmann::ordered_json;

/// One metric: its name and kind once, then its samples.
class Metric {
 public:
  Metric(std::string& text, std::string name, const char* type, const char* help)
      : text_{text}, name_{"mapletd_" + std::move(name)} {
    text_ += fmt::format("# HELP {0} {1}\n# TYPE {0} {2}\n", name_, help, type);
  }
  void sample(double value, const std::string& labels = "", const char* suffix = "") const {
    text_ +=
        fmt::format("{}{}{} {}\n", name_, suffix, labels.empty() ? "" : "{" + labels + "}", value);
  }

 private:
  std::string& text_;
  std::string name_;
};

double number(const Json& value) {
  if (value.is_boolean()) return value.get<bool>() ? 1.0 : 0.0;
  return value.is_number() ? value.get<double>() : 0.0;
}

}  // namespace

void print_security(const Json& security) {
  if (security["mode"] == "off") {
    if (security["sealed_heard"].get<std::int64_t>() > 0) {
      fmt::print("security  off; a secured team is heard ({} frames)\n",
                 security["sealed_heard"].get<std::int64_t>());
    }
    return;
  }
  std::string refused;
  for (const auto& [reason, count] : security["refused"].items()) {
    if (count.get<std::int64_t>() == 0) continue;
    refused +=
        fmt::format("{}{} {}", refused.empty() ? "" : ", ", count.get<std::int64_t>(), reason);
  }
  fmt::print("security  keys of generation {}, {}, until {}; refused: {}\n",
             security["generation"].get<std::uint32_t>(), security["state"].get<std::string>(),
             security["not_after"].get<std::string>(), refused.empty() ? "nothing" : refused);
}

void print_peer(const Json& peer) {
  fmt::print("agent {:<5} heard {:.1f} s ago{}  {}  {} records  loss {:.0f} %",
             peer["agent"].get<int>(), peer["heard_s_ago"].get<double>(),
             peer["ended"].get<bool>() ? " (an ended life)" : "",
             peer["in_sync"].get<bool>() ? "in sync" : "not in sync",
             peer["records"].get<std::int64_t>(), 100.0 * peer["loss"].get<double>());
  const Json& held = peer["held"];
  fmt::print("  held of it: {} delta-poses, {} closures, {} maplets\n",
             held["delta_poses"].get<std::int64_t>(), held["closures"].get<std::int64_t>(),
             held["maplets"].get<std::int64_t>());
}

namespace {

/// What survives a power cut, and why it does not; what is recorded. Nothing where nothing is kept.
void print_kept(const Json& s) {
  const Json& journal = s["journal"];
  const std::string problem = journal.value("problem", std::string{});
  const std::string folder = journal.value("directory", std::string{});
  if (!folder.empty()) {
    fmt::print("journal   {}{}{}: {}", journal["state"].get<std::string>(),
               problem.empty() ? "" : ", ", problem, folder);
    const Json& flushed = journal["flushed"];
    if (flushed.contains("maplets")) {
      fmt::print(", {} maplets and {} delta-poses safe", flushed["maplets"].get<std::int64_t>(),
                 flushed["delta_poses"].get<std::int64_t>());
    }
    fmt::print("{}\n", journal.value("clear_at_start", false) ? "; cleared at the next start" : "");
  }
  const Json recorder = s.value("recorder", Json::object());
  if (recorder.value("state", "off") == "off") return;
  const std::string ended = recorder.value("problem", std::string{});
  fmt::print("recorder  {}{}{}: {}, {:.1f} MB\n", recorder["state"].get<std::string>(),
             ended.empty() ? "" : ", ", ended, recorder["file"].get<std::string>(),
             recorder["bytes"].get<double>() / 1e6);
}

/// Other programs on the robot.
void print_neighbours(const Json& s) {
  const auto count = [](const Json& json, const char* key) {
    return json[key].get<std::int64_t>();
  };
  if (s.contains("ros2")) {
    const Json& ros = s["ros2"];
    fmt::print("ros2      {} subscribers; {} odometry, {} map markers said, {} dropped\n",
               count(ros, "subscribers"), count(ros, "odometry"), count(ros, "map_markers"),
               count(ros, "dropped") + count(ros, "failed"));
  }
  if (s.contains("external_odometry")) {
    const Json& e = s["external_odometry"];
    fmt::print("prior     external odometry: {} publishers, {} of {} messages used",
               count(e, "publishers"), count(e, "used"), count(e, "received"));
    for (const char* why : {"malformed", "wrong_frame", "other_clock", "backwards", "too_often",
                            "flooded", "leapt", "other_publisher"}) {
      if (count(e, why) > 0) fmt::print(", {} {}", count(e, why), why);
    }
    fmt::print("\n");
  }
  if (s.contains("autopilot")) {
    const Json& a = s["autopilot"];
    const std::string problem = a["problem"];
    fmt::print("autopilot {} records sent, {} not{}{}\n", count(a, "sent"), count(a, "failed"),
               problem.empty() ? "" : ": ", problem);
  }
}

}  // namespace

void print_status(const Json& s) {
  fmt::print("agent {} ({:08x}): {}, up {:.0f} s\n", s["agent"].get<int>(),
             s["epoch"].get<std::uint32_t>(), s["state"].get<std::string>(),
             s["uptime_s"].get<double>());
  fmt::print("frames    {} read, {} dropped; {}, {} lost\n",
             s["frames"]["read"].get<std::int64_t>(), s["frames"]["dropped"].get<std::int64_t>(),
             s["tracking"]["now"].get<bool>() ? "tracking" : "not tracking",
             s["tracking"]["lost"].get<std::int64_t>());
  fmt::print("map       {} maplets, {} delta-poses, {} closures; skeleton {} nodes, {} factors{}\n",
             s["maplets"].get<std::int64_t>(), s["delta_poses"].get<std::int64_t>(),
             s["closures"].get<std::int64_t>(), s["skeleton"]["nodes"].get<std::int64_t>(),
             s["skeleton"]["factors"].get<std::int64_t>(),
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
               e["listeners"].get<std::int64_t>(), e["records"].get<std::int64_t>(),
               e["missing"].get<std::int64_t>(), e["wire_bytes"].get<std::int64_t>(),
               e["dds_bytes"].get<std::int64_t>());
    if (e["conflicts"].get<std::int64_t>() > 0) {
      fmt::print("          two devices call themselves agent {}: give each its own --agent\n",
                 e["conflicting_agent"].get<int>());
    }
    if (e["lives_refused"].get<std::int64_t>() > 0) {
      fmt::print("          no room for the records of further agents: raise exchange.max_lives\n");
    }
    if (e["datagrams"]["future"].get<std::int64_t>() > 0) {
      fmt::print("          an agent speaks a newer version: update mapletd\n");
    }
    if (e["open"].get<bool>() && e["listeners"].get<std::int64_t>() == 0) {
      fmt::print(
          "          nobody listens: agents need the same dds.profile, radio_domain and "
          "network (mapletctl check)\n");
    }
  }
  if (s.contains("security")) print_security(s["security"]);
  print_neighbours(s);
  print_kept(s);
  for (const Json& peer : s["peers"]) print_peer(peer);
}

void add_stages(const Json& stages, std::string& text) {
  const Metric cpu{text, "stage_cpu_seconds", "gauge", "CPU time of a stage, by quantile"};
  for (const auto& [stage, time] : stages.items()) {
    cpu.sample(number(time["p50_us"]) / 1e6, fmt::format("stage=\"{}\",quantile=\"0.5\"", stage));
    cpu.sample(number(time["p99_us"]) / 1e6, fmt::format("stage=\"{}\",quantile=\"0.99\"", stage));
  }
  const Metric wall{text, "stage_seconds", "histogram", "Time of a stage on the monotonic clock"};
  for (const auto& [stage, time] : stages.items()) {
    const Json& histogram = time["histogram"];
    std::uint64_t sum = 0;
    for (std::size_t i = 0; i < histogram["counts"].size(); ++i) {
      sum += histogram["counts"][i].get<std::uint64_t>();
      const Json& upper = histogram["upper_us"][i];
      const std::string le =
          upper.is_null() ? "+Inf" : fmt::format("{}", upper.get<double>() / 1e6);
      wall.sample(static_cast<double>(sum), fmt::format("stage=\"{}\",le=\"{}\"", stage, le),
                  "_bucket");
    }
    const std::string label = fmt::format("stage=\"{}\"", stage);
    wall.sample(number(histogram["sum_us"]) / 1e6, label, "_sum");
    wall.sample(static_cast<double>(sum), label, "_count");
  }
  const Metric misses{text, "deadline_misses_total", "counter", "Runs of a stage over its budget"};
  for (const auto& [stage, time] : stages.items()) {
    misses.sample(number(time["deadline_misses"]), fmt::format("stage=\"{}\"", stage));
  }
}

std::string prometheus_text(const Json& s) {
  std::string text;
  Metric{text, "state", "gauge", "1 for the state that the daemon is in"}.sample(
      1.0, fmt::format("state=\"{}\"", s["state"].get<std::string>()));
  Metric{text, "uptime_seconds", "gauge", "Since its start"}.sample(number(s["uptime_s"]));
  const Metric frames{text, "frames_total", "counter", "Depth frames by what became of them"};
  for (const auto& [kind, value] : s["frames"].items()) {
    frames.sample(number(value), fmt::format("kind=\"{}\"", kind));
  }
  Metric{text, "tracking", "gauge", "1 while the camera is tracked"}.sample(
      number(s["tracking"]["now"]));
  Metric{text, "frames_lost_total", "counter", "Frames that were not tracked"}.sample(
      number(s["tracking"]["lost"]));
  for (const char* what : {"maplets", "delta_poses", "closures"}) {
    Metric{text, std::string{what} + "_total", "counter", "Made since the start"}.sample(
        number(s[what]));
  }
  Metric{text, "skeleton_nodes", "gauge", "Maplets in the skeleton"}.sample(
      number(s["skeleton"]["nodes"]));
  Metric{text, "skeleton_factors", "gauge", "Relations in the skeleton"}.sample(
      number(s["skeleton"]["factors"]));
  add_stages(s["stages"], text);
  const Metric fill{text, "fill", "gauge", "Of the stores that a mission fills"};
  for (const auto& [store, level] : s["memory"]["fill"].items()) {
    for (const auto& [what, value] : level.items()) {
      fill.sample(number(value), fmt::format("store=\"{}\",what=\"{}\"", store, what));
    }
  }
  for (const char* what : {"arena_bytes", "rss_bytes", "peak_rss_bytes", "limit_bytes"}) {
    if (!s["memory"].contains(what) || s["memory"][what].is_null()) continue;
    Metric{text, fmt::format("memory_{}", what), "gauge", "Memory of the process"}.sample(
        number(s["memory"][what]));
  }
  if (s.contains("exchange")) {
    const Json& e = s["exchange"];
    Metric{text, "wire_bytes_total", "counter", "IP bytes sent to other agents"}.sample(
        number(e["wire_bytes"]));
    Metric{text, "records", "gauge", "Records of all agents held here"}.sample(
        number(e["records"]));
    Metric{text, "records_missing", "gauge", "Records known to be missing here"}.sample(
        number(e["missing"]));
  }
  if (s.contains("security") && s["security"].contains("refused")) {
    const Metric refused{text, "refused_total", "counter", "Frames that were not believed"};
    for (const auto& [reason, count] : s["security"]["refused"].items()) {
      refused.sample(number(count), fmt::format("reason=\"{}\"", reason));
    }
  }
  if (!s["peers"].empty()) {
    const Metric heard{text, "peer_heard_seconds", "gauge", "Since another agent was heard"};
    for (const Json& peer : s["peers"]) {
      heard.sample(number(peer["heard_s_ago"]),
                   fmt::format("agent=\"{}\"", peer["agent"].get<int>()));
    }
  }
  return text;
}

}  // namespace maplet::ctl
