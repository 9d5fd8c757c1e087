// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <sstream>
#include <string>
#include <vector>

namespace maplet::synth {

/// What happens at one frame: `fault=KIND@FRAME[:AMOUNT]`, as often as wanted. Frames are counted
/// over all pluggings of a process.
struct Fault {
  enum class Kind {
    kStall,      ///< no frame for AMOUNT ms; stamps go on
    kUnplug,     ///< out, and in again after AMOUNT ms
    kLate,       ///< this frame AMOUNT ms after its time
    kDuplicate,  ///< the frame twice, with one index and stamp
    kBurst,      ///< AMOUNT frames at once
    kBlack,      ///< AMOUNT frames without any depth
    kCorrupt,    ///< AMOUNT frames that hold less than they say
    kMode,       ///< AMOUNT frames of half the size, as if somebody else had changed the mode
    kNoColour,   ///< AMOUNT frames without colour
    kBackwards,  ///< one frame with a stamp of AMOUNT ms ago
    kNone,
  };
  Kind kind = Kind::kNone;
  int frame = 0;
  int amount = 1;
  std::string name;

  static Fault parse(const std::string& text) {
    static const std::map<std::string, Kind> kinds{
        {"stall", Kind::kStall},         {"unplug", Kind::kUnplug}, {"late", Kind::kLate},
        {"duplicate", Kind::kDuplicate}, {"burst", Kind::kBurst},   {"black", Kind::kBlack},
        {"corrupt", Kind::kCorrupt},     {"mode", Kind::kMode},     {"no_colour", Kind::kNoColour},
        {"backwards", Kind::kBackwards}};
    const auto at = text.find('@');
    const auto kind = kinds.find(text.substr(0, at));
    if (at == std::string::npos || kind == kinds.end()) return {};
    const auto colon = text.find(':', at);
    Fault fault{kind->second, std::stoi(text.substr(at + 1)), 1, text.substr(0, at)};
    if (colon != std::string::npos) fault.amount = std::stoi(text.substr(colon + 1));
    return fault;
  }
  /// The first frame that is as ever again; 0 = not told by a frame.
  [[nodiscard]] int returns() const {
    if (kind == Kind::kUnplug) return 0;
    if (kind == Kind::kStall || kind == Kind::kLate) return frame;
    const bool counts = kind == Kind::kBlack || kind == Kind::kCorrupt || kind == Kind::kMode ||
                        kind == Kind::kNoColour || kind == Kind::kBurst;
    return frame + (counts ? amount : 1);
  }
  /// Whether it lasts at that frame: those that count frames.
  [[nodiscard]] bool lasts(int at) const { return at >= frame && at < frame + amount; }
};

/// How the synthetic camera behaves: the environment variable MAPLET_SYNTH, `key=value` parted by
/// spaces, read when the runtime starts (absent) and at every opening (the rest).
struct Script {
  std::string world = "room";                     ///< of the simulator
  std::map<std::string, std::string> parameters;  ///< sim.KEY=VALUE
  double rate_hz = 100.0;                         ///< of frames on the wall clock and in stamps
  int claimed_hz = -1;                            ///< rate that the modes claim; -1 = rate_hz
  int unplug = 0;       ///< after so many frames of one plugging the cable comes out; 0 = never
  int replug_ms = 0;    ///< and goes in again so much later; 0 = never
  int silent = 0;       ///< after so many frames none comes any more; 0 = never
  bool absent = false;  ///< nothing is plugged in at the start
  int absent_ms = 0;    ///< with absent: plugged in so much later; 0 = never
  std::vector<Fault> faults;
  std::string recording;     ///< folder in TUM layout: its images instead of the simulator's
  std::string log;           ///< file for what say() is told
  bool mirror = false;       ///< mirrors, and cannot be told not to
  bool depth = true;         ///< has a depth sensor
  bool colour = true;        ///< has a colour sensor
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

  /// A line in the log: `SECONDS begins|over KIND`, by the machine's monotonic clock.
  void say(const char* what, const Fault& fault) const {
    if (log.empty()) return;
    const std::chrono::duration<double> now = std::chrono::steady_clock::now().time_since_epoch();
    std::FILE* file = std::fopen(log.c_str(), "a");
    if (file == nullptr) return;
    std::fprintf(file, "%.6f %s %s\n", now.count(), what, fault.name.c_str());
    std::fclose(file);
  }

 private:
  void set(const std::string& key, const std::string& value) {
    const std::map<std::string, int*> counts{{"claimed_hz", &claimed_hz},
                                             {"unplug", &unplug},
                                             {"replug_ms", &replug_ms},
                                             {"silent", &silent},
                                             {"absent_ms", &absent_ms}};
    const std::map<std::string, bool*> flags{{"absent", &absent},
                                             {"mirror", &mirror},
                                             {"depth", &depth},
                                             {"colour", &colour},
                                             {"registration", &registration}};
    if (key == "fault") faults.push_back(Fault::parse(value));
    if (key == "world") world = value;
    if (key == "recording") recording = value;
    if (key == "log") log = value;
    if (key == "rate_hz") rate_hz = std::stod(value);
    if (key.starts_with("sim.")) parameters[key.substr(4)] = value;
    if (const auto count = counts.find(key); count != counts.end()) {
      *count->second = std::stoi(value);
    }
    if (const auto flag = flags.find(key); flag != flags.end()) *flag->second = value != "0";
  }
};

}  // namespace maplet::synth
