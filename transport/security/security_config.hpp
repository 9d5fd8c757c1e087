// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "core/base/field.hpp"

namespace maplet {

/// Who may read and speak on the link to the other agents. Section [security].
struct SecurityConfig {
  std::string mode = "off";
  std::string keys;
  int clock_tolerance_s = 300;

  static constexpr Field<SecurityConfig> kFields[] = {
      {"mode", &SecurityConfig::mode, 0, 0,
       "Link to other agents: off, sealed (each datagram encrypted and authenticated), or dds "
       "(that "
       "inside DDS Security; profile wifi)",
       "off|sealed|dds"},
      {"keys", &SecurityConfig::keys, 0, 0,
       "Folder that mapletctl keys agent wrote for this agent: agent.keys, and DDS Security's "
       "files"},
      {"clock_tolerance_s", &SecurityConfig::clock_tolerance_s, 0, 2e9,
       "By how much this machine's clock may be wrong when the dates of keys are looked at"},
  };

  [[nodiscard]] bool on() const noexcept { return mode != "off"; }
  [[nodiscard]] bool in_dds() const noexcept { return mode == "dds"; }
};

}  // namespace maplet
