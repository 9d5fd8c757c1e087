// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "daemon/clear_mission.hpp"
#include "daemon/console.hpp"
#include "daemon/log.hpp"
#include "daemon/neighbours_json.hpp"
#include "daemon/private_tmp.hpp"
#include "daemon/status_json.hpp"

namespace maplet::daemon {

namespace {

using Json = nlohmann::ordered_json;

Json error(const std::string& what) { return {{"error", what}}; }

Json key_json(const MapletKey& key) {
  return {{"agent", key.agent}, {"epoch", key.epoch}, {"id", key.id}};
}

bool names_two_maplets(const Json& question) {
  return is_number_of<std::uint16_t>(question.value("agent_a", Json{})) &&
         is_number_of<std::uint32_t>(question.value("id_a", Json{})) &&
         is_number_of<std::uint16_t>(question.value("agent_b", Json{})) &&
         is_number_of<std::uint32_t>(question.value("id_b", Json{}));
}

}  // namespace

Console::NewClosure Console::named(const nlohmann::ordered_json& q) {
  NewClosure closure;
  closure.agent_a = q["agent_a"].get<std::uint16_t>();
  closure.id_a = q["id_a"].get<std::uint32_t>();
  closure.agent_b = q["agent_b"].get<std::uint16_t>();
  closure.id_b = q["id_b"].get<std::uint32_t>();
  return closure;
}

std::string Console::reply(const std::string& line) {
  try {
    return answer_to(line);
  } catch (const Json::exception&) {  // a field of another type, or bytes that are no UTF-8
    return error("a field of the question is not what the command takes").dump();
  }
}

std::string Console::answer_to(const std::string& line) {
  const Json question = Json::parse(line, nullptr, false);
  if (!question.is_object() || !question.value("command", Json{}).is_string()) {
    return error("a question is a line of JSON with a command").dump();
  }
  const std::string command = question["command"];
  const Json agent = question.value("agent", Json{});
  if (command == "status") return status_text();
  if (command == "peers") return peers_text();
  if (command == "mission") return mission_text();
  if (command == "recorder") return recorder_text(question.value("out", std::string{}));
  if (command == "closures") return closures_text();
  if (command == "maplets") return maplets_text();
  if (command == "add") return add_text(line);
  if (command == "decide") return decide_text(line);
  if (command == "way") return way_text(line);
  if (command == "overlay") return overlay_text(line);
  if (command == "set") {
    return set_text(question.value("key", std::string{}), question.value("value", std::string{}));
  }
  if (command == "security") return security_text();
  if (command == "keys") return keys_text(question.value("notice", std::string{}));
  if (command == "radio") return radio_text(question.value("state", std::string{}));
  if (command == "why" && agent.is_number_integer()) return why_text(agent.get<int>());
  return error("mapletd does not know '" + command + "': mapletctl is newer, or older").dump();
}

std::string Console::status_text() const {
  const auto radio = about_us_.radio == nullptr
                         ? nullptr
                         : std::make_unique<RadioStatus>(about_us_.radio->status());
  Json json = status_json(about_us_.board.read(), about_us_.memory, radio.get());
  json["agent"] = about_us_.identity.agent;  // known before the first status is
  json["epoch"] = about_us_.identity.epoch;
  json["journal"] = mission_json();
  json["recorder"] =
      recorder_json(about_us_.flight != nullptr ? about_us_.flight->writer() : nullptr);
  if (about_us_.gpio != nullptr) json["gpio"] = gpio_json(about_us_.gpio->status());
  if (about_us_.gray != nullptr) json["gray_camera"] = gray_json(*about_us_.gray);
  if (about_us_.neighbours != nullptr) add_neighbours(about_us_.neighbours->status(), json);
  return json.dump();
}

nlohmann::ordered_json Console::mission_json() const {
  const StateDirectory* state = about_us_.state;
  Json json =
      journal_json(about_us_.journal != nullptr ? about_us_.journal->status() : JournalStatus{});
  if (about_us_.journal == nullptr) json["problem"] = state != nullptr ? state->problem() : "";
  const bool kept = state != nullptr && !state->path().empty();
  json["directory"] = kept ? std::filesystem::absolute(state->path()).string() : "";
  json["clear_at_start"] = state != nullptr && clear_is_asked(state->path());
  return json;
}

std::string Console::mission_text() const {
  Json json = mission_json();
  json["agent"] = about_us_.identity.agent;
  json["epoch"] = about_us_.identity.epoch;
  return json.dump();
}

std::string Console::security_text() const {
  if (about_us_.radio == nullptr) return error("mapletd runs without DDS (--no-dds)").dump();
  return security_json(about_us_.radio->status().security).dump();
}

std::string Console::keys_text(const std::string& notice) const {
  LinkSecurity* security = about_us_.radio == nullptr ? nullptr : about_us_.radio->security();
  if (security == nullptr) return error("security is off here (security.mode)").dump();
  const auto done = security->load(notice);
  if (!done) return error(done.error()).dump();
  log_info("security: an operator's notice: " + *done);
  return Json{{"done", *done}, {"generation", security->status().generation}}.dump();
}

std::string Console::recorder_text(const std::string& file) const {
  FlightWriter* writer = about_us_.flight != nullptr ? about_us_.flight->writer() : nullptr;
  if (writer == nullptr) {
    return error("that mapletd records nothing: set recorder.file in its configuration").dump();
  }
  if (file.empty()) return error("recorder: name a file").dump();
  if (const std::string tmp = private_tmp_of(file); !tmp.empty()) {
    const std::string& state = about_us_.state != nullptr ? about_us_.state->path() : std::string{};
    return error(tmp + " is that service's own (systemd's PrivateTmp), nobody else would find " +
                 file + ": name a file in " +
                 (state.empty() ? "a folder of its ReadWritePaths" : state))
        .dump();
  }
  const bool whole = !writer->ended();
  if (const std::string problem = writer->save(file); !problem.empty())
    return error(problem).dump();
  return Json{{"file", file}, {"whole", whole}}.dump();
}

std::string Console::peers_text() const {
  Json json = Json::array();
  if (about_us_.radio != nullptr) {
    const auto radio = std::make_unique<RadioStatus>(about_us_.radio->status());
    for (std::size_t i = 0; i < radio->peer_count; ++i) {
      json.push_back(peer_json(radio->peers[i]));
    }
  }
  return json.dump();
}

std::string Console::why_text(int agent) {
  Json json{{"agent", agent}, {"heard", false}};
  if (about_us_.radio != nullptr) {
    const auto radio = std::make_unique<RadioStatus>(about_us_.radio->status());
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
  if (agent == about_us_.identity.agent) {
    reason = "that is this agent";
  } else if (merged) {
    reason =
        fmt::format("{} of its {} maplets stand in one group with ours", why_.related, why_.nodes);
  } else if (why_.nodes == 0) {
    reason = json["heard"] ? "heard, but none of its delta-poses is here yet"
                           : "never heard, and nobody relayed anything of it";
  } else if (why_.closures == 0) {
    reason = fmt::format(
        "no place was found that both saw; {} of its maplets compared{}", why_.looked.maplets,
        why_.looked.pairs == 0
            ? ", none looked alike enough to try"
            : fmt::format(", {} pairs, best overlap {:.0f} %, the last one: {}", why_.looked.pairs,
                          100.0 * why_.looked.best_overlap, why_.looked.reason));
  } else if (why_.closures_torn > 0) {
    reason = fmt::format(
        "{} closures between the two say two different things, about as many each: undecided until "
        "more is seen, or one side is rejected by hand",
        why_.closures_torn);
  } else if (why_.closures_kept > 0) {
    reason = fmt::format(
        "{} closures with what we mapped before the last start or gap are kept; where we have been "
        "since is not related to that yet",
        why_.closures_kept);
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
                    {"rejected", line.weight < 1e-3},
                    {"undecided", line.torn}});
  }
  return json.dump();
}

std::string Console::maplets_text() {
  if (!ask(Question::kMaplets, 0)) return error("the estimator did not answer within 3 s").dump();
  Json json = Json::array();
  for (std::size_t i = 0; i < maplet_count_; ++i) {
    const MapletLine& line = maplets_[i];
    const Eigen::Vector3d& t = line.node.T_world_maplet.t;
    const Eigen::Quaterniond& q = line.node.T_world_maplet.q;
    json.push_back({{"agent", line.node.key.agent},
                    {"epoch", line.node.key.epoch},
                    {"id", line.node.key.id},
                    {"bytes", line.bytes},
                    {"map", key_json(line.node.gauge)},
                    {"T_map_maplet", {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()}}});
  }
  return json.dump();
}

std::string Console::set_text(const std::string& key, const std::string& value) {
  const auto changes = about_us_.config.set(key, value);
  if (!changes) return error(changes.error()).dump();
  log_info("set by mapletctl: " + to_line(*changes));
  Json json = Json::array();
  for (const ConfigChange& change : *changes) {
    json.push_back({{"key", change.key}, {"was", change.was}, {"is", change.is}});
  }
  return json.dump();
}

std::string Console::add_text(const std::string& line) {
  const Json q = Json::parse(line, nullptr, false);
  const Json pose = q.value("T_a_b", Json{});
  const bool numbers =
      pose.is_array() && pose.size() == 7 &&
      std::all_of(pose.begin(), pose.end(), [](const Json& v) { return v.is_number(); });
  if (!numbers || !names_two_maplets(q)) {
    return error("closure add: two maplets AGENT:ID and seven numbers of T_a_b").dump();
  }
  NewClosure closure = named(q);
  closure.T_a_b.t = {pose[0].get<double>(), pose[1].get<double>(), pose[2].get<double>()};
  closure.T_a_b.q = {pose[6].get<double>(), pose[3].get<double>(), pose[4].get<double>(),
                     pose[5].get<double>()};
  if (closure.T_a_b.q.norm() < 0.5) return error("closure add: that is no rotation").dump();
  {
    const std::scoped_lock lock{question_mutex_};
    new_closure_ = closure;
  }
  if (!ask(Question::kAdd, 0)) return error("the estimator did not answer within 3 s").dump();
  if (added_ == AddedClosure::kUnknownMaplet) {
    return error("closure add: the skeleton does not have both maplets").dump();
  }
  return Json{{"added", added_ == AddedClosure::kAdded}}.dump();
}

std::string Console::decide_text(const std::string& line) {
  const Json q = Json::parse(line, nullptr, false);
  if (!names_two_maplets(q) || !q.value("accept", Json{}).is_boolean()) {
    return error("closure reject, restore: two maplets AGENT:ID").dump();
  }
  {
    const std::scoped_lock lock{question_mutex_};
    new_closure_ = named(q);
    accept_ = q["accept"].get<bool>();
  }
  if (!ask(Question::kDecide, 0)) return error("the estimator did not answer within 3 s").dump();
  if (decided_ < 0) return error("the skeleton does not have both maplets").dump();
  if (decided_ == 0) return error("there is no closure between the two (closure list)").dump();
  return Json{{"closures", decided_}, {"accepted", q["accept"]}}.dump();
}

std::string Console::radio_text(const std::string& what) {
  if (about_us_.radio == nullptr)
    return error("mapletd runs with --no-dds: there is no radio").dump();
  if (what != "silent" && what != "on") return error("radio: silent or on").dump();
  about_us_.radio->set_silent(what == "silent");
  return Json{{"radio", what}}.dump();
}

}  // namespace maplet::daemon
