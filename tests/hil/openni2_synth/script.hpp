// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>
#include <map>
#include <sstream>
#include <string>

namespace maplet::synth {

/// How the synthetic camera behaves: the environment variable MAPLET_SYNTH, `key=value` parted by
/// spaces, read when the runtime starts (absent) and at every opening (the rest).
struct Script {
  std::string world = "room";                     ///< of the simulator
  std::map<std::string, std::string> parameters;  ///< sim.KEY=VALUE
  double rate_hz = 100.0;                         ///< of frames on the wall clock and in stamps
  int unplug = 0;       ///< after so many frames of one plugging the cable comes out; 0 = never
  int replug_ms = 0;    ///< and goes in again so much later; 0 = never
  int silent = 0;       ///< after so many frames none comes any more; 0 = never
  bool absent = false;  ///< nothing is plugged in at the start
  bool mirror = false;  ///< mirrors, and cannot be told not to
  bool depth = true;    ///< has a depth sensor
  bool colour = true;   ///< has a colour sensor
  bool registration = true;  ///< can register depth to colour

  [[nodiscard]] static Script from_environment() {
    Script script;
    const char* text = std::getenv("MAPLET_SYNTH");
    std::istringstream words{text ? text : ""};
    for (std::string word; words >> word;) {
      const auto equals = word.find('=');
      if (equals == std::string::npos) continue;
      script.set(word.substr(0, equals), word.substr(equals + 1));
    }
    return script;
  }

 private:
  void set(const std::string& key, const std::string& value) {
    const std::map<std::string, int*> counts{
        {"unplug", &unplug}, {"replug_ms", &replug_ms}, {"silent", &silent}};
    const std::map<std::string, bool*> flags{{"absent", &absent},
                                             {"mirror", &mirror},
                                             {"depth", &depth},
                                             {"colour", &colour},
                                             {"registration", &registration}};
    if (key == "world") world = value;
    if (key == "rate_hz") rate_hz = std::stod(value);
    if (key.starts_with("sim.")) parameters[key.substr(4)] = value;
    if (const auto count = counts.find(key); count != counts.end()) {
      *count->second = std::stoi(value);
    }
    if (const auto flag = flags.find(key); flag != flags.end()) *flag->second = value != "0";
  }
};

}  // namespace maplet::synth
