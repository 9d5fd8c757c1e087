// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "daemon/config.hpp"

namespace maplet::daemon {

/// What `mapletctl check` found of one thing.
struct CheckResult {
  enum class Result : std::uint8_t { kOk, kWarn, kFail };
  std::string name;
  Result result = Result::kOk;
  std::string detail;
  std::string remedy;  ///< empty: nothing to do
};

[[nodiscard]] std::string_view to_string(CheckResult::Result result) noexcept;

/// Looks at what the daemon will need with this configuration: camera and its permissions, GPIO
/// chips, clock, network interface and peers, memory, real-time limits. Changes nothing; opens each
/// camera for a moment.
/// @param state  the folder of --state; empty: none
[[nodiscard]] std::vector<CheckResult> self_check(const Config& config, const std::string& state);

}  // namespace maplet::daemon
