// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/self_check.hpp"

#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/timex.h>
#include <unistd.h>

#include <array>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <optional>

#include "core/base/arena_exhausted.hpp"
#include "daemon/memory_ledger.hpp"
#include "daemon/memory_status.hpp"
#include "daemon/network_check.hpp"
#include "daemon/run_setup.hpp"
#include "daemon/security_setup.hpp"
#include "drivers/gpio/gpio_line.hpp"
#include "drivers/gray_camera.hpp"
#include "drivers/open_source.hpp"
#include "drivers/openni2/cameras.hpp"

namespace maplet::daemon {

namespace {

namespace fs = std::filesystem;
using Result = CheckResult::Result;
constexpr double kMiB = 1048576.0;

CheckResult ok(std::string name, std::string detail) {
  return {std::move(name), Result::kOk, std::move(detail), {}};
}

std::string first_word_of(const fs::path& file) {
  std::ifstream in{file};
  std::string word;
  in >> word;
  return word;
}

/// Depth cameras on the USB that this user may not open.
void check_usb(std::vector<CheckResult>& results) {
  constexpr std::array<std::string_view, 2> kVendors{"1d27", "2bc5"};
  std::error_code error;
  for (const auto& entry : fs::directory_iterator{"/sys/bus/usb/devices", error}) {
    const std::string vendor = first_word_of(entry.path() / "idVendor");
    if (std::find(kVendors.begin(), kVendors.end(), vendor) == kVendors.end()) continue;
    const int bus = std::atoi(first_word_of(entry.path() / "busnum").c_str());
    const int number = std::atoi(first_word_of(entry.path() / "devnum").c_str());
    const std::string node = fmt::format("/dev/bus/usb/{:03}/{:03}", bus, number);
    if (access(node.c_str(), R_OK | W_OK) == 0) {
      results.push_back(ok("usb", fmt::format("depth camera {} may be opened", node)));
      continue;
    }
    results.push_back({"usb", Result::kFail, node + ": this user may not open the depth camera",
                       "install 60-mapletd.rules into /lib/udev/rules.d, udevadm control --reload, "
                       "plug the camera in again; be in the group plugdev"});
  }
}

void check_camera(std::vector<CheckResult>& results, const Config& config) {
  if (const std::string& uri = config.input.source; !uri.empty() && !uri.starts_with("openni2:")) {
    const auto opened = open_source(uri, source_options(config));
    results.push_back(
        opened ? ok("camera", uri + " can be read")
               : CheckResult{"camera", Result::kFail, opened.error().what, "correct input.source"});
    return;
  }
  check_usb(results);
  const auto cameras = openni2_cameras();
  if (!cameras) {
    results.push_back({"camera", Result::kFail, "OpenNI2 does not start: " + cameras.error(),
                       "install libopenni2-0"});
    return;
  }
  if (cameras->empty()) {
    results.push_back({"camera", Result::kFail, "OpenNI2 finds no camera",
                       "connect one; when it is connected, see usb, or its driver is missing"});
  }
  for (const CameraInfo& camera : *cameras) {
    if (!camera.problem.empty()) {
      results.push_back({"camera", Result::kFail, camera.uri + " does not open: " + camera.problem,
                         "end the program that uses it (mapletd?); check its permissions"});
    } else if (camera.depth_modes.empty()) {
      results.push_back({"camera", Result::kWarn, camera.uri + " has no depth", ""});
    } else {
      results.push_back(
          ok("camera", fmt::format("{} ({}): {}", camera.uri, camera.name, camera.depth_modes)));
    }
  }
}

void check_gray(std::vector<CheckResult>& results, const GrayConfig& config) {
  const auto cameras = libcamera_cameras();
  if (!cameras) {
    results.push_back({"libcamera", config.used() ? Result::kFail : Result::kOk, cameras.error(),
                       config.used() ? "install libcamera0.0.3 and libcamera-ipa" : ""});
    return;
  }
  const std::string id = config.used() ? config.source.substr(config.source.find(':') + 1) : "";
  bool found = id.empty() && !cameras->empty();
  for (const std::string& camera : *cameras) {
    results.push_back(ok("libcamera", camera));
    found = found || (!id.empty() && camera.starts_with(id));
  }
  if (!config.used()) {
    if (cameras->empty()) results.push_back(ok("libcamera", "no camera, and none is asked for"));
  } else if (!found) {
    results.push_back({"libcamera", Result::kWarn,
                       "gray_camera.source = " + config.source + ": no such camera",
                       "connect it, and be in the group video; depth goes on alone meanwhile"});
  }
}

void check_gpio(std::vector<CheckResult>& results, const GpioConfig& config) {
  const auto chips = gpio_chips();
  for (const GpioChip& chip : chips) {
    if (chip.problem.empty()) {
      results.push_back(
          ok("gpio", fmt::format("{} ({}): {} lines", chip.name, chip.label, chip.lines)));
    } else {
      results.push_back({"gpio", Result::kWarn, chip.name + ": " + chip.problem,
                         "add the user to the chip's group (gpio)"});
    }
  }
  if (chips.empty() && !config.used()) results.push_back(ok("gpio", "no chip, no lines to use"));
  for (const std::string* line :
       {&config.tracking, &config.heartbeat, &config.hold, &config.pulse}) {
    if (line->empty()) continue;
    // As an input: nothing that hangs on the line is moved.
    const auto opened = GpioLine::open(*line, false, GpioLine::Use::kInput);
    results.push_back(opened ? ok("gpio", "line '" + *line + "' is free")
                             : CheckResult{"gpio", config.required ? Result::kFail : Result::kWarn,
                                           opened.error(),
                                           "while mapletd runs, its lines are in use by it"});
  }
}

void check_clock(std::vector<CheckResult>& results) {
  constexpr std::time_t kBuilt = 1'700'000'000;  // no clock that is set is earlier
  timex state{};
  const bool synchronised = adjtimex(&state) != TIME_ERROR;
  if (std::time(nullptr) < kBuilt) {
    results.push_back({"clock", Result::kWarn, "the clock is not set",
                       "set it, or run a time service: stamps of logs are wrong, the map is not"});
  } else if (!synchronised) {
    results.push_back({"clock", Result::kWarn, "the clock is set, and follows no time service",
                       "run chrony or systemd-timesyncd where the robot has a network"});
  } else {
    results.push_back(ok("clock", "set and synchronised"));
  }
}

std::string amount(rlim_t bytes) {
  if (bytes == RLIM_INFINITY) return "unlimited";
  return fmt::format("{:.1f} MiB", static_cast<double>(bytes) / kMiB);
}

void check_memory(std::vector<CheckResult>& results, const Config& config) {
  std::optional<MemoryLedger> ledger;
  try {
    ledger = memory_ledger(config, {});
  } catch (const ArenaExhausted& e) {
    results.push_back({"memory", Result::kFail, std::string{"the stages would need "} + e.what(),
                       "lower [limits], maplet and skeleton sizes"});
    return;
  }
  const std::size_t need = unit_memory_bytes(*ledger);
  // A 32-bit system's size_t would not hold 4 GiB.
  const auto there = static_cast<std::uint64_t>(sysconf(_SC_PHYS_PAGES)) *
                     static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
  const auto group = cgroup_memory_limit();
  const std::string detail =
      fmt::format("needs {:.1f} MiB of {:.0f} MiB{}", static_cast<double>(need) / kMiB,
                  static_cast<double>(there) / kMiB,
                  group ? fmt::format(", limited to {}", amount(*group)) : "");
  const std::uint64_t least = group ? std::min(there, *group) : there;
  if (need > least) {
    results.push_back({"memory", Result::kFail, detail,
                       "lower [limits] (mapletd --print-memory), or raise MemoryMax"});
  } else if (2 * need > there) {
    results.push_back(
        {"memory", Result::kWarn, detail, "little is left for the rest of the robot"});
  } else {
    results.push_back(ok("memory", detail));
  }
  rlimit lock{};
  getrlimit(RLIMIT_MEMLOCK, &lock);
  if (config.realtime.lock_memory && geteuid() != 0 && lock.rlim_cur < ledger->arena_bytes) {
    results.push_back({"memory lock", config.realtime.required ? Result::kFail : Result::kWarn,
                       fmt::format("{} may be locked, the arena has {}", amount(lock.rlim_cur),
                                   amount(ledger->arena_bytes)),
                       "grant LimitMEMLOCK (the unit does; ulimit -l)"});
  } else {
    results.push_back(ok("memory lock", "the arena may be locked"));
  }
}

void check_realtime(std::vector<CheckResult>& results, const RealtimeConfig& realtime) {
  const int wanted = std::max(realtime.capture_priority, realtime.estimator_priority);
  if (wanted == 0) {
    results.push_back(ok("real time", "not asked for (realtime.*_priority = 0)"));
    return;
  }
  rlimit limit{};
  getrlimit(RLIMIT_RTPRIO, &limit);
  if (geteuid() == 0 || limit.rlim_cur >= static_cast<rlim_t>(wanted)) {
    results.push_back(ok("real time", fmt::format("priority {} is granted", wanted)));
    return;
  }
  results.push_back({"real time", realtime.required ? Result::kFail : Result::kWarn,
                     fmt::format("priority {} is not granted, at most {}", wanted, limit.rlim_cur),
                     fmt::format("grant LimitRTPRIO={}", wanted)});
}

void check_security(std::vector<CheckResult>& results, const Config& config,
                    const std::string& state) {
  const auto setup = open_security(config, {}, state);
  if (!setup) {
    results.push_back(
        {"security", Result::kFail, setup.error(), "mapletctl keys; docs/security.md"});
    return;
  }
  if (!*setup) {
    results.push_back(ok("security", "off: anybody on the link reads and speaks"));
    return;
  }
  for (const std::string& line : (*setup)->said) {
    results.push_back({"security", Result::kWarn, line, "docs/security.md"});
  }
  const KeyStanding at = (*setup)->standing();
  const std::string dates =
      problem(at.keys.validity, std::time(nullptr), config.security.clock_tolerance_s);
  if (at.revoked()) {
    results.push_back({"security", Result::kFail,
                       fmt::format("the operator has revoked the keys of agent {} (generation {})",
                                   at.keys.agent, std::max(at.told, at.keys.generation)),
                       "give the robot another number: mapletctl keys agent"});
  } else if (!dates.empty()) {
    results.push_back(
        {"security", Result::kFail, "the keys are " + dates, "mapletctl keys rotate"});
  } else if (at.behind()) {
    results.push_back({"security", Result::kWarn,
                       fmt::format("generation {} has begun, and the keys of agent {} are of {}",
                                   at.told, at.keys.agent, at.keys.generation),
                       "mapletctl keys load with all of newest.notice, or keys agent --renew"});
  } else {
    results.push_back(
        ok("security", fmt::format("keys of agent {}, generation {}, until {}", at.keys.agent,
                                   at.keys.generation, utc(at.keys.validity.not_after_s))));
  }
}

}  // namespace

std::string_view to_string(Result result) noexcept {
  switch (result) {
    case Result::kOk:
      return "OK";
    case Result::kWarn:
      return "WARN";
    case Result::kFail:
      return "FAIL";
  }
  return "?";
}

std::vector<CheckResult> self_check(const Config& config, const std::string& state) {
  std::vector<CheckResult> results;
  check_camera(results, config);
  check_gray(results, config.gray);
  check_gpio(results, config.gpio);
  check_clock(results);
  check_network(results, config.radio);
  check_security(results, config, state);
  check_memory(results, config);
  check_realtime(results, config.realtime);
  return results;
}

}  // namespace maplet::daemon
