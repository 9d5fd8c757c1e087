// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Ways along the skeleton, and the map that lies over it.
#include <nlohmann/json.hpp>

#include "daemon/console.hpp"
#include "daemon/status_json.hpp"

namespace maplet::daemon {

namespace {

using Json = nlohmann::ordered_json;

std::string error(const char* what) { return Json{{"error", what}}.dump(); }

Json key_json(const MapletKey& key) {
  return {{"agent", key.agent}, {"epoch", key.epoch}, {"id", key.id}};
}

Json numbers(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

// The latest life of it.
bool Console::find_place(const Skeleton& skeleton, const PlaceName& name,
                         MapletKey& key) const noexcept {
  bool found = false;
  for (int i = 0; i < skeleton.node_count(); ++i) {
    const MapletKey other = skeleton.node(i).key;
    if (other.agent != name.agent || (name.id && other.id != *name.id)) continue;
    key = other;
    found = true;
  }
  return found;
}

void Console::find_way(Agent& agent) noexcept {
  MapletKey from;
  MapletKey to;
  way_ = {};
  places_known_ =
      find_place(agent.skeleton(), from_, from) && find_place(agent.skeleton(), to_, to);
  if (!places_known_) return;
  way_ = agent.way(from, to, way_maplets_);
  for (int i = 0; i < way_.count; ++i) {
    maplets_[i].node = {way_maplets_[i], agent.skeleton().gauge(from),
                        *agent.skeleton().pose(way_maplets_[i])};
  }
}

// A part of the map between two frames: maplets are decoded for it.
void Console::lay_part_over(Agent& agent) noexcept {
  const Skeleton& skeleton = agent.skeleton();
  MapletKey newest;
  overlay_ = {};
  plane_count_ = 0;
  next_node_ = -1;
  places_known_ = find_place(skeleton, {about_us_.identity.agent, std::nullopt}, newest);
  if (!places_known_) return;
  HeldMaplets held = agent.held_maplets();
  overlay_ = lay_over(
      skeleton, skeleton.gauge(newest), held, fidelity_,
      [&](const PlacedPlane& p) {
        if (plane_count_ == kMaxPlanes) return;
        planes_[plane_count_++] = {p.maplet.key, p.plane, p.T_world_maplet * p.part.centre,
                                   p.part.area_m2};
      },
      first_node_, kMapletsAtOnce);
  if (first_node_ + kMapletsAtOnce < skeleton.node_count())
    next_node_ = first_node_ + kMapletsAtOnce;
}

std::string Console::way_text(const std::string& line) {
  const Json q = Json::parse(line, nullptr, false);
  const auto read = [&](const char* agent, const char* id, PlaceName& name) {
    const Json a = q.value(agent, Json{});
    const Json i = q.value(id, Json{});
    if (!is_number_of<std::uint16_t>(a) || (!i.is_null() && !is_number_of<std::uint32_t>(i))) {
      return false;
    }
    name = {a.get<std::uint16_t>(), std::nullopt};
    if (!i.is_null()) name.id = i.get<std::uint32_t>();
    return true;
  };
  PlaceName from{about_us_.identity.agent, std::nullopt};
  PlaceName to;
  if ((q.contains("agent_a") && !read("agent_a", "id_a", from)) || !read("agent_b", "id_b", to)) {
    return error("way: from a maplet, or here, to a maplet AGENT:ID or an AGENT's newest");
  }
  {
    const std::scoped_lock lock{question_mutex_};
    from_ = from;
    to_ = to;
  }
  if (!ask(Question::kWay, 0)) return error("the estimator did not answer within 3 s");
  if (!places_known_) return error("way: the skeleton does not have both places");
  if (way_.count == 0) return error("way: nothing that is known connects the two (mapletctl why)");
  Json json{{"length_m", way_.length_m}, {"map", key_json(maplets_[0].node.gauge)}};
  json["maplets"] = Json::array();
  for (int i = 0; i < way_.count; ++i) {
    const Skeleton::NodeView& node = maplets_[i].node;
    const Eigen::Quaterniond& q_map = node.T_world_maplet.q;
    Json pose = numbers(node.T_world_maplet.t);
    for (const double v : {q_map.x(), q_map.y(), q_map.z(), q_map.w()}) pose.push_back(v);
    Json maplet = key_json(node.key);
    maplet["T_map_maplet"] = pose;
    json["maplets"].push_back(maplet);
  }
  return json.dump();
}

std::string Console::overlay_text(const std::string& line) {
  const Json q = Json::parse(line, nullptr, false);
  const Json fidelity = q.value("fidelity", Json(1.0));
  const Json first = q.value("first", Json(0));
  if (!fidelity.is_number() || !(fidelity.get<double>() >= 0.0 && fidelity.get<double>() <= 1.0) ||
      !first.is_number_integer() || first.get<int>() < 0) {
    return error("overlay: a fidelity of 0 to 1, and the node to begin with");
  }
  {
    const std::scoped_lock lock{question_mutex_};
    fidelity_ = fidelity.get<double>();
    first_node_ = first.get<int>();
  }
  if (!ask(Question::kOverlay, 0)) return error("the estimator did not answer within 3 s");
  if (!places_known_) return error("overlay: this agent has no maplet yet");
  Json json{{"maplets", overlay_.maplets},
            {"missing", overlay_.missing},
            {"area_m2", overlay_.area_m2},
            {"left_out", static_cast<std::size_t>(overlay_.planes) - plane_count_}};
  json["next"] = next_node_ < 0 ? Json{} : Json(next_node_);
  json["planes"] = Json::array();
  for (std::size_t i = 0; i < plane_count_; ++i) {
    const PlaneLine& p = planes_[i];
    json["planes"].push_back({{"maplet", key_json(p.maplet)},
                              {"n", numbers(p.plane.n)},
                              {"d", p.plane.d},
                              {"centre", numbers(p.centre)},
                              {"area_m2", p.area_m2}});
  }
  return json.dump();
}

}  // namespace maplet::daemon
