// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/tracking_json.hpp"

#include <string>

namespace maplet::daemon {

namespace {

using Json = nlohmann::ordered_json;

Json axis_json(const Eigen::Vector3d& axis, double sigma) {
  if (sigma == 0.0) return nullptr;
  return Json::array({axis.x(), axis.y(), axis.z()});
}

}  // namespace

void add_tracking(const TrackerCounters& counted, Json& json) {
  json["recovered"] = counted.recovered;
  json["gaps"] = counted.segments + counted.leaps;
  json["tied"] = counted.tied;
  json["returned"] = counted.returned;
  json["with_gray"] = counted.with_gray;
  json["with_moving"] = counted.with_moving;
  json["hints_used"] = counted.hints_used;
  json["hints_refused"] = counted.hints_refused;
  for (std::size_t i = 1; i < kLosses; ++i) {
    json["lost_because"][std::string{to_string(static_cast<Loss>(i))}] = counted.by_loss[i];
  }
}

void add_free_axes(const FreeAxes& free, Json& json) {
  json["free_sigma_m"] = free.sigma_m;
  json["free_axis"] = axis_json(free.along, free.sigma_m);
  json["free_turn_sigma_rad"] = free.sigma_rad;
  json["free_turn_axis"] = axis_json(free.about, free.sigma_rad);
}

}  // namespace maplet::daemon
