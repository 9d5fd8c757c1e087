// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <string>

#include "core/base/field.hpp"

namespace maplet::daemon {

/// Lines of GPIO chips. Section [gpio]; a line without a name is not used.
struct GpioConfig {
  std::string tracking;
  bool tracking_active_low = false;
  std::string heartbeat;
  bool heartbeat_active_low = false;
  double heartbeat_hz = 2.0;
  std::string hold;
  bool hold_active_low = false;
  Duration hold_debounce = std::chrono::milliseconds{30};
  std::string pulse;
  bool pulse_active_low = false;
  bool required = false;

  [[nodiscard]] bool used() const noexcept {
    return !(tracking.empty() && heartbeat.empty() && hold.empty() && pulse.empty());
  }

  static constexpr Field<GpioConfig> kFields[] = {
      {"tracking", &GpioConfig::tracking, 0, 0,
       "Output: on while the camera is tracked; a line's NAME, CHIP:NAME or CHIP:NUMBER, empty = "
       "none, as for all lines"},
      {"tracking_active_low", &GpioConfig::tracking_active_low, 0, 0, "On is low"},
      {"heartbeat", &GpioConfig::heartbeat, 0, 0,
       "Output: a square wave while the estimator gets on, for an external watchdog"},
      {"heartbeat_active_low", &GpioConfig::heartbeat_active_low, 0, 0, "On is low"},
      {"heartbeat_hz", &GpioConfig::heartbeat_hz, 0.1, 50.0, "Whole waves a second"},
      {"hold", &GpioConfig::hold, 0, 0, "Input: while it is on no frame is worked at"},
      {"hold_active_low", &GpioConfig::hold_active_low, 0, 0, "On is low"},
      {"hold_debounce_ms", &GpioConfig::hold_debounce, 0, 1000,
       "The switch counts once it was quiet for so long"},
      {"pulse", &GpioConfig::pulse, 0, 0,
       "Input: a pulse a second (PPS) that says how long a second is"},
      {"pulse_active_low", &GpioConfig::pulse_active_low, 0, 0,
       "The second begins with the falling edge"},
      {"required", &GpioConfig::required, 0, 0,
       "Refuse to start without one of the lines; else say it and run without that line"},
  };
};

}  // namespace maplet::daemon
