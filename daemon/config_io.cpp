// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/config_io.hpp"

#include <fmt/format.h>

#include <bit>
#include <filesystem>
#include <fstream>
#include <numeric>
#include <sstream>
#include <utility>
#include <vector>

#include "daemon/autopilot_address.hpp"
#include "daemon/config_keys.hpp"
#include "daemon/gray_setup.hpp"
#include "daemon/pose_text.hpp"
#include "transport/ros2/names.hpp"

namespace maplet::daemon {

namespace {

std::string at(std::string_view name, const toml::node& node) {
  return fmt::format("{}:{}", name, node.source().begin.line);
}

std::string on_one_line(const toml::node& value) {
  std::ostringstream shown;
  shown << toml::node_view<const toml::node>{value};
  std::string line;
  for (const char c : shown.str()) {
    const bool space = c == '\n' || c == ' ';
    if (!space) line += c;
    if (space && !line.empty() && line.back() != ' ') line += ' ';
  }
  return line;
}

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i + 1);
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t changed = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({changed, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row.back();
}

/// " (perhaps frame.budget_us)" when a key of some section is spelled nearly so.
std::string perhaps(std::string_view section, std::string_view name) {
  const ConfigKey* nearest = nullptr;
  std::size_t least = 3;
  for (const ConfigKey& key : config_keys()) {
    const std::size_t distance = edit_distance(key.name, name) + (key.section == section ? 0 : 1);
    if (distance < least) {
      least = distance;
      nearest = &key;
    }
  }
  return nearest == nullptr ? "" : fmt::format(" (perhaps {})", nearest->full_name());
}

tl::expected<void, ConfigError> apply(Config& config, const toml::table& root,
                                      std::string_view name) {
  const auto set = [&](const ConfigKey& key, const toml::node& value) -> std::string {
    const std::string problem = key.set(config, value);
    if (problem.empty()) return {};
    return fmt::format("{}: {} = {}: {}", at(name, value), key.full_name(), on_one_line(value),
                       problem);
  };
  for (const auto& [section, node] : root) {
    if (const ConfigKey* key = find_key("", section.str())) {
      if (const std::string problem = set(*key, node); !problem.empty()) {
        return tl::unexpected{problem};
      }
      continue;
    }
    const toml::table* table = node.as_table();
    if (table == nullptr || !is_section(section.str())) {
      return tl::unexpected{
          fmt::format("{}: unknown {} '{}'; mapletd --print-config lists all keys", at(name, node),
                      table ? "section" : "key", section.str())};
    }
    for (const auto& [key_name, value] : *table) {
      const ConfigKey* key = find_key(section.str(), key_name.str());
      if (key == nullptr) {
        return tl::unexpected{fmt::format(
            "{}: unknown key '{}.{}'{}; mapletd --print-config lists all keys", at(name, value),
            section.str(), key_name.str(), perhaps(section.str(), key_name.str()))};
      }
      if (const std::string problem = set(*key, value); !problem.empty()) {
        return tl::unexpected{problem};
      }
    }
  }
  return {};
}

/// What other programs on the robot are told: one line when it makes no sense.
std::string outside_problem(const Config& config) {
  if (!pose_of(config.body.T_body_camera)) {
    return fmt::format(
        "body.T_body_camera = '{}': must be x,y,z,qx,qy,qz,qw with a quaternion of length 1",
        config.body.T_body_camera);
  }
  if (std::string problem = names_problem(config.ros2); !problem.empty()) return problem;
  if (!config.autopilot.used()) return {};
  const auto address = DatagramAddress::parse(config.autopilot.destination);
  return address ? "" : "autopilot.destination = " + address.error();
}

}  // namespace

tl::expected<void, ConfigError> check_together(const Config& config) {
  const MapletConfig& maplet = config.agent.maplet;
  if (maplet.overlap_keyframes >= maplet.max_keyframes) {
    return tl::unexpected{
        fmt::format("maplet: overlap_keyframes = {} must be less than max_keyframes = {}",
                    maplet.overlap_keyframes, maplet.max_keyframes)};
  }
  const PatchConfig& patches = config.agent.patches;
  if (patches.cell_px > patches.max_node_px) {
    return tl::unexpected{fmt::format("patches: cell_px = {} must not be above max_node_px = {}",
                                      patches.cell_px, patches.max_node_px)};
  }
  if (patches.cell_px > 0 && !std::has_single_bit(static_cast<unsigned>(patches.cell_px))) {
    return tl::unexpected{
        fmt::format("patches: cell_px = {} is no power of two: 4, 8, 16, 32, 64, or 0 to let the "
                    "image's size choose",
                    patches.cell_px)};
  }
  const CameraConfig& camera = config.camera;
  const bool any = camera.width_px || camera.height_px || camera.fx_px != 0 || camera.fy_px != 0;
  const bool all = camera.width_px && camera.height_px && camera.fx_px != 0 && camera.fy_px != 0;
  if (any && !all) {
    return tl::unexpected<ConfigError>{
        "camera: width_px, height_px, fx_px and fy_px go together: give all four, or none"};
  }
  if (std::string problem = config.radio.problem(config.dds.domain); !problem.empty()) {
    return tl::unexpected{std::move(problem)};
  }
  if (config.security.on() && config.security.keys.empty()) {
    return tl::unexpected<ConfigError>{
        "security: mode needs keys = DIR: mapletctl keys init and keys agent make them"};
  }
  if (config.security.in_dds() && config.radio.profile != "wifi") {
    return tl::unexpected<ConfigError>{
        "security: mode = 'dds' takes 20 kB a pair of agents: for profile 'radio' choose 'sealed'"};
  }
  if (const auto gray = gray_options(config.gray); !gray) return tl::unexpected{gray.error()};
  if (std::string problem = outside_problem(config); !problem.empty())
    return tl::unexpected{std::move(problem)};
  const LimitsConfig& limits = config.agent.limits;
  if (config.gray.used() && (config.gray.width_px > limits.image_width_px ||
                             config.gray.height_px > limits.image_height_px)) {
    return tl::unexpected{fmt::format(
        "gray_camera: {}x{} is larger than limits.image_width_px = {}, image_height_px = {}",
        config.gray.width_px, config.gray.height_px, limits.image_width_px,
        limits.image_height_px)};
  }
  return {};
}

tl::expected<Config, ConfigError> parse_config(std::string_view text, std::string_view name) {
  Config config;
  try {
    const toml::table root = toml::parse(text, name);
    if (const auto applied = apply(config, root, name); !applied) {
      return tl::unexpected{applied.error()};
    }
  } catch (const toml::parse_error& e) {
    return tl::unexpected{
        fmt::format("{}:{}: not TOML: {}", name, e.source().begin.line, e.description())};
  }
  return config;
}

tl::expected<Config, ConfigError> load_config(const std::string& path) {
  std::ifstream file{path};
  if (!file || std::filesystem::is_directory(path)) {
    return tl::unexpected{path +
                          ": cannot be read; give --config a TOML file (mapletd "
                          "--print-config writes one)"};
  }
  const std::string text{std::istreambuf_iterator<char>{file}, {}};
  return parse_config(text, path);
}

tl::expected<void, ConfigError> set_key(Config& config, std::string_view assignment) {
  const std::string name = fmt::format("--set {}", assignment);
  const std::size_t equals = assignment.find('=');
  if (equals == std::string_view::npos) {
    return tl::unexpected{name + ": must be key=value, as in --set frame.budget_us=15000"};
  }
  const std::string key{assignment.substr(0, equals)};
  const std::string value{assignment.substr(equals + 1)};
  toml::table root;
  try {
    root = toml::parse(key + " = " + value);
  } catch (const toml::parse_error&) {
    try {
      std::ostringstream quoted;
      quoted << toml::value<std::string>{value};
      root = toml::parse(key + " = " + quoted.str());
    } catch (const toml::parse_error& e) {
      return tl::unexpected{fmt::format("{}: {}", name, e.description())};
    }
  }
  auto applied = apply(config, root, name);
  return applied;
}

std::string print_config(const Config& config) {
  std::string text = "# mapletd configuration. All keys, with their ranges.\n";
  std::string section;
  for (const ConfigKey& key : config_keys()) {
    if (key.section != section && !key.section.empty()) {
      section = key.section;
      text += fmt::format("\n[{}]\n", section);
    }
    text += fmt::format("# {} ({})\n{} = {}\n", key.help, key.range, key.name, key.print(config));
  }
  return text;
}

}  // namespace maplet::daemon
