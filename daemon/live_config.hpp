// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/config.hpp"
#include "daemon/config_io.hpp"

namespace maplet::daemon {

/// A key whose value is wanted otherwise than the daemon runs with.
struct ConfigChange {
  std::string key;
  std::string was;
  std::string is;
  bool live = false;  ///< it took effect; else it waits for a restart
};

/// One line for the log: "frame.budget_us 20000.0 -> 15000.0; after a restart: ...".
[[nodiscard]] std::string to_line(const std::vector<ConfigChange>& changes);

/// The configuration of a running daemon. Sizes are decided at start; what decides nothing but pace
/// may change while it runs.
///
/// Memory   allocates, but for frame_budget().
/// Threads  any; frame_budget() without waiting.
class LiveConfig {
 public:
  /// @param changed  called with the new configuration, on the thread that changed it
  LiveConfig(const Config& config, std::function<void(const Config&)> changed);

  [[nodiscard]] Duration frame_budget() const noexcept {
    return Duration{frame_budget_ns_.load(std::memory_order_relaxed)};
  }

  /// Takes what is live of a configuration that was read anew.
  /// @return every key that differs
  std::vector<ConfigChange> take(const Config& wanted);

  /// Sets one live key.
  /// @return the change, nothing when it had that value, or why not
  tl::expected<std::vector<ConfigChange>, ConfigError> set(const std::string& key,
                                                           const std::string& value);

  /// The keys that may change while the daemon runs.
  [[nodiscard]] static const std::vector<std::string_view>& live_keys();

 private:
  std::vector<ConfigChange> take_locked(const Config& wanted);

  std::mutex mutex_;
  Config config_;
  std::function<void(const Config&)> changed_;
  std::atomic<Duration::rep> frame_budget_ns_;
};

}  // namespace maplet::daemon
