// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/live_config.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "daemon/config_keys.hpp"

namespace maplet::daemon {

namespace {

std::string joined(const std::vector<ConfigChange>& changes, bool live) {
  std::string text;
  for (const ConfigChange& change : changes) {
    if (change.live != live) continue;
    text +=
        fmt::format("{}{} {} -> {}", text.empty() ? "" : ", ", change.key, change.was, change.is);
  }
  return text;
}

bool is_live(std::string_view key) {
  const auto& keys = LiveConfig::live_keys();
  return std::find(keys.begin(), keys.end(), key) != keys.end();
}

}  // namespace

std::string to_line(const std::vector<ConfigChange>& changes) {
  const std::string now = joined(changes, true);
  const std::string later = joined(changes, false);
  if (now.empty() && later.empty()) return "nothing changed";
  if (later.empty()) return now;
  return fmt::format("{}after a restart: {}", now.empty() ? "" : now + "; ", later);
}

const std::vector<std::string_view>& LiveConfig::live_keys() {
  static const std::vector<std::string_view> keys{"frame.budget_us", "dds.budget_bytes_per_s",
                                                  "exchange.maplets"};
  return keys;
}

LiveConfig::LiveConfig(const Config& config, std::function<void(const Config&)> changed)
    : config_{config},
      changed_{std::move(changed)},
      frame_budget_ns_{config.agent.frame.budget.count()} {}

std::vector<ConfigChange> LiveConfig::take(const Config& wanted) {
  const std::scoped_lock lock{mutex_};
  return take_locked(wanted);
}

std::vector<ConfigChange> LiveConfig::take_locked(const Config& wanted) {
  std::vector<ConfigChange> changes;
  bool any_live = false;
  for (const ConfigKey& key : config_keys()) {
    ConfigChange change{key.full_name(), key.print(config_), key.print(wanted),
                        is_live(key.full_name())};
    if (change.was == change.is) continue;
    if (change.live && set_key(config_, change.key + "=" + change.is)) any_live = true;
    changes.push_back(std::move(change));
  }
  if (any_live) {
    frame_budget_ns_ = config_.agent.frame.budget.count();
    changed_(config_);
  }
  return changes;
}

tl::expected<std::vector<ConfigChange>, ConfigError> LiveConfig::set(const std::string& key,
                                                                     const std::string& value) {
  const std::scoped_lock lock{mutex_};
  Config wanted = config_;
  if (const auto done = set_key(wanted, key + "=" + value); !done) {
    return tl::unexpected{done.error()};
  }
  if (!is_live(key)) {
    std::string all;
    for (const std::string_view live : live_keys()) all += fmt::format(" {}", live);
    return tl::unexpected{
        fmt::format("{} is decided at start: change it in the configuration and restart; while the "
                    "daemon runs these may change:{}",
                    key, all)};
  }
  if (const auto fits = check_together(wanted); !fits) return tl::unexpected{fits.error()};
  return take_locked(wanted);
}

}  // namespace maplet::daemon
