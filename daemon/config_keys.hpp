// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <toml++/toml.h>

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/config.hpp"

namespace maplet::daemon {

/// One key of any stage, without its type.
struct ConfigKey {
  std::string section;  ///< empty: before all sections
  std::string name;
  std::string help;
  std::string range;  ///< as a person reads it
  /// @return what the value must be; empty when it is that, and was taken
  std::function<std::string(Config&, const toml::node&)> set;
  std::function<std::string(const Config&)> print;

  [[nodiscard]] std::string full_name() const {
    return section.empty() ? name : section + "." + name;
  }
};

/// All keys, section by section, from the stages' field tables.
[[nodiscard]] const std::vector<ConfigKey>& config_keys();

/// @return nullptr when there is no such key
[[nodiscard]] const ConfigKey* find_key(std::string_view section, std::string_view name);

[[nodiscard]] bool is_section(std::string_view section);

}  // namespace maplet::daemon
