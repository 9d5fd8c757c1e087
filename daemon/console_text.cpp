// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "core/ports/stage_meter.hpp"
#include "daemon/console.hpp"
#include "transport/exchange/record_key.hpp"

namespace maplet::daemon {

namespace {

using Json = nlohmann::ordered_json;

std::string hex(std::uint64_t value) { return fmt::format("{:016x}", value); }

Json error(const std::string& what) { return {{"error", what}}; }

Json key_json(const MapletKey& key) {
  return {{"agent", key.agent}, {"epoch", key.epoch}, {"id", key.id}};
}

Json streams_json(const std::array<std::uint32_t, kStreams>& counts) {
  Json json;
  for (std::size_t i = 0; i < kStreams; ++i) {
    json[std::string{to_string(static_cast<Stream>(i))}] = counts[i];
  }
  return json;
}

Json peer_json(const RadioStatus::PeerStatus& status) {
  const Peer& peer = status.peer;
  const double all = static_cast<double>(peer.datagrams + peer.lost);
  Json json{{"agent", peer.life.agent},
            {"epoch", peer.life.epoch},
            {"heard_s_ago", status.silent_s},
            {"in_sync", status.in_sync},
            {"ended", peer.superseded},
            {"records", peer.records},
            {"held", streams_json(status.held_of)},
            {"datagrams", peer.datagrams},
            {"loss", all > 0.0 ? static_cast<double>(peer.lost) / all : 0.0},
            {"bytes", peer.bytes},
            {"new_records", peer.new_records}};
  if (peer.has_offset) {
    json["clock_offset_s"] = seconds(peer.clock_offset);
    json["round_trip_s"] = seconds(peer.delay);
  }
  return json;
}

Json exchange_json(const RadioStatus& radio) {
  const NodeCounters& n = radio.counters;
  return {{"open", radio.open},
          {"silent", radio.silent},
          {"in_sync", radio.settled},
          {"listeners", radio.listeners},
          {"records", radio.records},
          {"records_digest", hex(radio.records_digest)},
          {"own", streams_json(radio.own)},
          {"missing", radio.missing},
          {"wire_bytes", radio.wire_bytes},
          {"dds_bytes", radio.dds_bytes},
          {"bytes_last_10_s", radio.window_bytes},
          {"delta_pose_bytes", radio.lane_bytes[0]},
          {"closure_bytes", radio.lane_bytes[1]},
          {"range_bytes", radio.lane_bytes[2]},
          {"control_bytes", radio.lane_bytes[3]},
          {"maplet_bytes", radio.lane_bytes[4]},
          {"conflicts", radio.conflicts},
          {"conflicting_agent", radio.conflicting_agent},
          {"datagrams",
           {{"in", n.datagrams_in},
            {"out", n.datagrams_out},
            {"damaged", n.damaged},
            {"future", n.future},
            {"malformed", n.malformed}}},
          {"received", n.received},
          {"duplicates", n.duplicates},
          {"conflicting", n.conflicting},
          {"forged_own", n.forged_own},
          {"refused", n.refused},
          {"maplets",
           {{"kept", radio.maplets.kept},
            {"received", radio.maplets.received},
            {"damaged", radio.maplets.damaged},
            {"given_up", radio.maplets.given_up},
            {"bytes_sent", radio.maplets.bytes_sent}}}};
}

}  // namespace

std::string Console::reply(const std::string& line) {
  const Json question = Json::parse(line, nullptr, false);
  if (!question.is_object() || !question.value("command", Json{}).is_string()) {
    return error("a question is a line of JSON with a command").dump();
  }
  const std::string command = question["command"];
  const Json agent = question.value("agent", Json{});
  if (command == "status") return status_text();
  if (command == "peers") return peers_text();
  if (command == "closures") return closures_text();
  if (command == "add") return add_text(line);
  if (command == "radio") return radio_text(question.value("state", std::string{}));
  if (command == "why" && agent.is_number_integer()) return why_text(agent.get<int>());
  return error("mapletd does not know '" + command + "': mapletctl is newer, or older").dump();
}

std::string Console::status_text() const {
  StatusRecord s;
  bool settled = false;
  {
    const std::scoped_lock lock{mutex_};
    s = status_;
    settled = settled_;
  }
  const auto radio = radio_ == nullptr ? nullptr : std::make_unique<RadioStatus>(radio_->status());
  Json json{{"agent", identity_.agent},
            {"epoch", identity_.epoch},
            {"state", to_string(s.state)},
            {"uptime_s", static_cast<double>(s.uptime_ms) / 1e3},
            {"frames",
             {{"read", s.frames_read},
              {"processed", s.frames_processed},
              {"dropped", s.frames_dropped}}}};
  for (std::size_t i = 0; i < kStages; ++i) {
    const StageTime& t = s.stages[i];
    json["stages"][std::string{kStageNames[i]}] = {{"p50_us", t.p50_us},
                                                   {"p99_us", t.p99_us},
                                                   {"max_us", t.max_us},
                                                   {"deadline_misses", t.deadline_misses}};
  }
  json["memory"] = {{"arena_bytes", s.arena_bytes}, {"rss_bytes", s.rss_bytes}};
  json["tracking"] = {{"now", s.tracking}, {"keyframes", s.keyframes}, {"lost", s.frames_lost}};
  json["maplets"] = s.maplets;
  json["delta_poses"] = s.delta_poses;
  json["closures"] = s.closures;
  json["skeleton"] = {{"nodes", s.nodes},
                      {"factors", s.factors},
                      {"settled", settled},
                      {"records_digest", hex(radio ? radio->records_digest : 0)}};
  json["peers"] = Json::array();
  if (radio) {
    json["exchange"] = exchange_json(*radio);
    for (std::size_t i = 0; i < radio->peer_count; ++i) {
      json["peers"].push_back(peer_json(radio->peers[i]));
    }
  }
  json["journal"] = {{"flushed", Json::object()}};
  return json.dump();
}

std::string Console::peers_text() const {
  Json json = Json::array();
  if (radio_ != nullptr) {
    const auto radio = std::make_unique<RadioStatus>(radio_->status());
    for (std::size_t i = 0; i < radio->peer_count; ++i) {
      json.push_back(peer_json(radio->peers[i]));
    }
  }
  return json.dump();
}

std::string Console::why_text(int agent) {
  Json json{{"agent", agent}, {"heard", false}};
  if (radio_ != nullptr) {
    const auto radio = std::make_unique<RadioStatus>(radio_->status());
    for (std::size_t i = 0; i < radio->peer_count; ++i) {
      if (radio->peers[i].peer.life.agent != agent || radio->peers[i].peer.superseded) continue;
      json["heard"] = true;
      json["peer"] = peer_json(radio->peers[i]);
    }
  }
  if (!ask(Question::kWhy, agent)) return error("the estimator did not answer within 3 s").dump();
  json["maplets_in_skeleton"] = why_.nodes;
  json["closures"] = {{"between", why_.closures}, {"kept", why_.closures_kept}};
  json["compared"] = {{"maplets", why_.looked.maplets},
                      {"pairs", why_.looked.pairs},
                      {"accepted", why_.looked.accepted},
                      {"best_overlap", why_.looked.best_overlap},
                      {"last_reason", why_.looked.reason}};
  const bool merged = why_.related > 0;
  json["merged"] = merged;
  std::string reason;
  if (agent == identity_.agent) {
    reason = "that is this agent";
  } else if (merged) {
    reason =
        fmt::format("{} of its {} maplets stand in one group with ours", why_.related, why_.nodes);
  } else if (why_.nodes == 0) {
    reason = json["heard"] ? "heard, but none of its delta-poses is here yet"
                           : "never heard, and nobody relayed anything of it";
  } else if (why_.closures == 0) {
    reason = fmt::format(
        "no place was found that both saw; {} of its maplets compared, {} pairs, "
        "the last one: {}",
        why_.looked.maplets, why_.looked.pairs, why_.looked.reason);
  } else {
    reason = "all closures between the two are rejected";
  }
  json["reason"] = reason;
  return json.dump();
}

std::string Console::closures_text() {
  if (!ask(Question::kClosures, 0)) {
    return error("the estimator did not answer within 3 s").dump();
  }
  Json json = Json::array();
  for (std::size_t i = 0; i < closure_count_; ++i) {
    const ClosureLine& line = closures_[i];
    json.push_back({{"a", key_json(line.a)},
                    {"b", key_json(line.b)},
                    {"length_m", line.length_m},
                    {"chi2", line.chi2},
                    {"weight", line.weight},
                    {"rejected", line.refused || line.weight < 1e-3}});
  }
  return json.dump();
}

std::string Console::add_text(const std::string& line) {
  const Json q = Json::parse(line, nullptr, false);
  const Json pose = q.value("T_a_b", Json{});
  const bool numbers =
      pose.is_array() && pose.size() == 7 &&
      std::all_of(pose.begin(), pose.end(), [](const Json& v) { return v.is_number(); });
  for (const char* key : {"agent_a", "id_a", "agent_b", "id_b"}) {
    if (!numbers || !q.value(key, Json{}).is_number_unsigned()) {
      return error("closure add: two maplets AGENT:ID and seven numbers of T_a_b").dump();
    }
  }
  NewClosure closure;
  closure.agent_a = q["agent_a"].get<std::uint16_t>();
  closure.id_a = q["id_a"].get<std::uint32_t>();
  closure.agent_b = q["agent_b"].get<std::uint16_t>();
  closure.id_b = q["id_b"].get<std::uint32_t>();
  closure.T_a_b.t = {pose[0].get<double>(), pose[1].get<double>(), pose[2].get<double>()};
  closure.T_a_b.q = {pose[6].get<double>(), pose[3].get<double>(), pose[4].get<double>(),
                     pose[5].get<double>()};
  {
    const std::scoped_lock lock{question_mutex_};
    new_closure_ = closure;
  }
  if (closure.T_a_b.q.norm() < 0.5) return error("closure add: that is no rotation").dump();
  if (!ask(Question::kAdd, 0)) return error("the estimator did not answer within 3 s").dump();
  if (added_ == AddedClosure::kUnknownMaplet) {
    return error("closure add: the skeleton does not have both maplets").dump();
  }
  return Json{{"added", added_ == AddedClosure::kAdded}}.dump();
}

std::string Console::radio_text(const std::string& what) {
  if (radio_ == nullptr) return error("mapletd runs with --no-dds: there is no radio").dump();
  if (what != "silent" && what != "on") return error("radio: silent or on").dump();
  radio_->set_silent(what == "silent");
  return Json{{"radio", what}}.dump();
}

}  // namespace maplet::daemon
