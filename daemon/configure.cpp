// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/configure.hpp"

#include "daemon/flight_setup.hpp"
#include "drivers/open_source.hpp"

namespace maplet::daemon {

tl::expected<Config, ConfigError> configure(const Options& options) {
  if (!options.source.empty()) {
    if (const auto uri = check_source(options.source); !uri) return tl::unexpected{uri.error()};
  }
  auto config = options.config_file.empty() ? tl::expected<Config, ConfigError>{Config{}}
                                            : load_config(options.config_file);
  if (is_record(options.source) && options.config_file.empty())
    config = recorded_config(options.source);
  for (const std::string& assignment : options.overrides) {
    if (!config) break;
    if (const auto set = set_key(*config, assignment); !set) return tl::unexpected{set.error()};
  }
  if (config && !options.source.empty()) config->input.source = options.source;
  if (config && options.source.empty() && !config->input.source.empty()) {
    if (const auto uri = check_source(config->input.source); !uri) {
      return tl::unexpected{uri.error()};
    }
  }
  if (config) {
    if (const auto checked = check_together(*config); !checked) {
      const std::string where = options.config_file.empty() ? "" : options.config_file + ": ";
      return tl::unexpected{where + checked.error()};
    }
  }
  return config;
}

}  // namespace maplet::daemon
