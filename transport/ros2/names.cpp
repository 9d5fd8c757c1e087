// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/ros2/names.hpp"

#include <fmt/format.h>

#include <cctype>
#include <initializer_list>
#include <string_view>

namespace maplet {

namespace {

constexpr std::size_t kMostName = 120;
constexpr std::size_t kMostFrame = 40;

/// Words of letters, digits and single underscores, none beginning with a digit, between slashes.
bool is_name(std::string_view name) {
  if (name.starts_with('/')) name.remove_prefix(1);
  if (name.empty() || name.size() > kMostName || name.find("__") != std::string_view::npos)
    return false;
  char before = '/';
  for (const char c : name) {
    const auto octet = static_cast<unsigned char>(c);
    if (c == '/' ? before == '/' : std::isalnum(octet) == 0 && c != '_') return false;
    if (before == '/' && std::isdigit(octet) != 0) return false;
    before = c;
  }
  return before != '/';
}

bool is_frame(std::string_view frame) {
  for (const char c : frame) {
    if (std::isgraph(static_cast<unsigned char>(c)) == 0) return false;
  }
  return !frame.empty() && frame.size() <= kMostFrame && !frame.starts_with('/');
}

}  // namespace

std::string dds_topic(const std::string& name_space, const std::string& name) {
  if (name.starts_with('/')) return "rt" + name;
  std::string prefix = name_space;
  if (prefix.starts_with('/')) prefix.erase(0, 1);
  return prefix.empty() ? "rt/" + name : "rt/" + prefix + "/" + name;
}

std::string names_problem(const Ros2Config& config) {
  struct Named {
    const char* key;
    const std::string& value;
    bool may_be_empty = false;
  };
  for (const auto& [key, value, may_be_empty] :
       std::initializer_list<Named>{{"namespace", config.name_space, true},
                                    {"odometry_topic", config.odometry_topic},
                                    {"external_odometry", config.external_odometry, true}}) {
    if ((value.empty() && may_be_empty) || is_name(value)) continue;
    return fmt::format(
        "ros2.{} = '{}': must be a ROS 2 name, as robot1 or wheel/odometry: words of letters, "
        "digits and underscores between slashes",
        key, value);
  }
  for (const auto& [key, value, may_be_empty] :
       std::initializer_list<Named>{{"map_frame", config.map_frame},
                                    {"odom_frame", config.odom_frame},
                                    {"base_frame", config.base_frame},
                                    {"external_frame", config.external_frame, true}}) {
    if ((value.empty() && may_be_empty) || is_frame(value)) continue;
    return fmt::format(
        "ros2.{} = '{}': must be a frame's name, as base_link: up to {} characters without spaces "
        "and without a slash in front",
        key, value, kMostFrame);
  }
  if (config.map_frame == config.odom_frame || config.odom_frame == config.base_frame ||
      config.map_frame == config.base_frame) {
    return "ros2: map_frame, odom_frame and base_frame must be three names";
  }
  const std::string odometry = dds_topic(config.name_space, config.odometry_topic);
  for (const std::string& other :
       {dds_topic(config.name_space, "path"), dds_topic(config.name_space, "map_markers"),
        std::string{"rt/tf"}, std::string{"rt/diagnostics"}}) {
    if (odometry != other) continue;
    return fmt::format(
        "ros2.odometry_topic = '{}' is a topic of another type that mapletd publishes: give the "
        "odometry a name of its own, as odom",
        config.odometry_topic);
  }
  if (config.enabled && !config.external_odometry.empty() &&
      dds_topic(config.name_space, config.external_odometry) == odometry) {
    return fmt::format(
        "ros2.external_odometry = '{}' is the topic that mapletd publishes: name the other "
        "odometry's, or give ours another name with ros2.odometry_topic",
        config.external_odometry);
  }
  return {};
}

}  // namespace maplet
