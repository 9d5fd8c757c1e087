// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/neighbours_json.hpp"

#include <cstring>

namespace maplet::daemon {

namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kVerdicts[] = {"used",      "malformed", "other_clock",    "backwards",
                                     "too_often", "leapt",     "other_publisher"};
static_assert(std::size(kVerdicts) == ExternalOdometry::kVerdicts);

}  // namespace

void add_neighbours(const Neighbours::Status& status, Json& json) {
  if (status.ros) {
    const Ros2Link::Status& ros = *status.ros;
    json["ros2"] = {
        {"clock", status.system_clock ? "system" : "source"},
        {"subscribers", ros.topics.subscribers},
        {"odometry", ros.topics.odometry},
        {"tf", ros.topics.tf},
        {"path", ros.topics.path},
        {"map_markers", ros.topics.map},
        {"diagnostics", ros.topics.diagnostics},
        {"failed", ros.topics.failed},
        {"dropped", ros.dropped},
        {"map",
         {{"maplets", ros.map.maplets}, {"quads", ros.map.quads}, {"left_out", ros.map.left_out}}}};
  }
  if (status.external) {
    const auto& [inbox, counted] = *status.external;
    Json& external = json["external_odometry"];
    external = {{"publishers", inbox.publishers}, {"received", inbox.received}};
    for (std::size_t i = 0; i < ExternalOdometry::kVerdicts; ++i)
      external[kVerdicts[i]] = counted.by_verdict[i];
    external["wrong_frame"] = inbox.wrong_frame;
    external["flooded"] = inbox.flooded;
    external["restarts"] = counted.restarts;
    external["covariances_left"] = counted.covariances_left;
  }
  if (status.autopilot) {
    const AutopilotLink::Status& autopilot = *status.autopilot;
    json["autopilot"] = {{"sent", autopilot.sent},
                         {"failed", autopilot.failed},
                         {"problem", autopilot.error == 0 ? "" : std::strerror(autopilot.error)}};
  }
}

}  // namespace maplet::daemon
