// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/mapletctl/patch_options.hpp"

#include <fmt/core.h>
#include <time.h>

#include <charconv>

#include "tools/mapletctl/command.hpp"

namespace maplet::ctl {

namespace {

double clock_us(clockid_t id) {
  timespec now{};
  clock_gettime(id, &now);
  return static_cast<double>(now.tv_sec) * 1e6 + static_cast<double>(now.tv_nsec) * 1e-3;
}

void set_field(PatchConfig& config, const std::string& assignment) {
  const std::size_t equals = assignment.find('=');
  const std::string key = assignment.substr(0, equals);
  for (const Field<PatchConfig>& field : PatchConfig::kFields) {
    if (field.key != key || equals == std::string::npos) continue;
    double value = 0.0;
    const char* end = assignment.data() + assignment.size();
    const auto [stop, error] = std::from_chars(assignment.data() + equals + 1, end, value);
    if (error != std::errc{} || stop != end || !(value >= field.min && value <= field.max)) {
      throw Failure{
          fmt::format("--set {}: takes a number from {} to {}", assignment, field.min, field.max),
          2};
    }
    if (const auto* number = std::get_if<double PatchConfig::*>(&field.member)) {
      config.** number = value;
    } else if (const auto* whole = std::get_if<int PatchConfig::*>(&field.member)) {
      config.** whole = static_cast<int>(value);
    } else if (const auto* flag = std::get_if<bool PatchConfig::*>(&field.member)) {
      config.** flag = value != 0.0;
    }
    return;
  }
  throw Failure{
      fmt::format("--set {}: no such key of the patches (mapletctl patches --help)", assignment),
      2};
}

}  // namespace

void PatchOptions::add_to(Command command) {
  command.add_option("--budget-us", budget_us_, "Wall time of a frame; 0 = as long as it takes")
      .non_negative();
  command.add_option("--max-patches", max_patches_, "Patches of a frame at most")
      .range(1, static_cast<int>(kMaxPatches));
  command
      .add_option("--noise", noise_,
                  "Kind of sensor that a recording or camera is: its typical noise model")
      .one_of({kSensorKindNames.begin(), kSensorKindNames.end()});
  command.add_option("--set", set_, "A setting of the patches stage, without its section")
      .type_name("KEY=VALUE");
  std::string footer = "Settings (--set KEY=VALUE):\n";
  for (const Field<PatchConfig>& field : PatchConfig::kFields) {
    footer += fmt::format("  {:<20}{} ({} to {})\n", field.key, field.help, field.min, field.max);
  }
  command.footer(footer);
}

PatchConfig PatchOptions::config() const {
  PatchConfig config;
  for (const std::string& assignment : set_) set_field(config, assignment);
  if (max_patches_ > 0) config.max_patches = max_patches_;
  return config;
}

SourceOptions PatchOptions::source() const {
  SourceOptions options;
  options.noise = typical_noise(*sensor_kind(noise_));
  return options;
}

Deadline PatchOptions::deadline() const {
  if (budget_us_ == 0) return Deadline::never();
  return Deadline{clock_, std::chrono::microseconds{budget_us_}};
}

Timed::Timed() : cpu_us_{clock_us(CLOCK_THREAD_CPUTIME_ID)}, wall_us_{clock_us(CLOCK_MONOTONIC)} {}
double Timed::cpu_us() const { return clock_us(CLOCK_THREAD_CPUTIME_ID) - cpu_us_; }
double Timed::wall_us() const { return clock_us(CLOCK_MONOTONIC) - wall_us_; }

}  // namespace maplet::ctl
