// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/options.hpp"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>

namespace maplet::daemon {

namespace {

constexpr const char* kDescription =
    "mapletd: maps with a depth camera in fixed memory and bounded time, and shares the map.\n\n"
    "With --out it processes the source to its end, writes trajectory, maplets, skeleton, "
    "pictures\n"
    "and report.json into that folder, and exits. Without --out it is the service: it runs until\n"
    "SIGTERM, waits for a camera that is not there yet, and publishes on DDS.";

constexpr const char* kFooter =
    "\nExamples:\n"
    "  mapletd --source sim:loop --out out/loop          a simulated loop, as fast as it goes\n"
    "  mapletd --source tum:DIR --out out/run            a recording in TUM RGB-D layout\n"
    "  mapletd --source openni2: --config robot.toml     the service, first OpenNI2 camera\n"
    "  mapletd --source record:FILE --out out/again      a recorded run, bit for bit\n"
    "  mapletctl watch                                   what it publishes, in another terminal\n\n"
    "Signals: SIGTERM and SIGINT end it, everything saved; SIGHUP reads the configuration again.\n"
    "Exit status: 0 done, 1 failure (input, device, environment), 2 usage or configuration.";

int usage_error(const char* what) {
  std::fprintf(stderr, "mapletd: %s (mapletd --help)\n", what);
  return 2;
}

}  // namespace

int parse_options(int argc, char** argv, Options& options) {
  CLI::App app{kDescription};
  app.footer(kFooter);
  app.set_version_flag("--version", "mapletd " MAPLET_VERSION);
  app.add_option("--config", options.config_file, "TOML file; --print-config lists all keys");
  app.add_option("--set", options.overrides, "key=value over the file, as often as you like")
      ->allow_extra_args(false);
  app.add_option("--source", options.source,
                 "tum:DIR[?first=N&count=M&every=K], openni2:[DEVICE-URI|FILE.oni], "
                 "sim:room|loop|corridor|symmetric[?seed=N&frames=M], record:FILE (what the flight "
                 "recorder holds, again)");
  app.add_option("--out", options.out, "Folder for the results of a finite run");
  if (const char* folders = std::getenv("STATE_DIRECTORY")) {  // systemd's: a list
    options.state = std::string{folders}.substr(0, std::string_view{folders}.find(':'));
  }
  app.add_option("--state", options.state,
                 "Folder of the mission's journal: what survives a power cut; default "
                 "$STATE_DIRECTORY, none = no journal")
      ->option_text("DIR");
  std::string pace = "fast";
  app.add_option(
         "--pace", pace,
         "Of recordings: fast (default; limits in counts decide, results are bit-identical) "
         "or recorded (wall clock, deadlines decide)")
      ->check(CLI::IsMember({"fast", "recorded"}))
      ->option_text("fast|recorded");
  int agent = options.agent;
  app.add_option("--agent", agent, "This agent's number, unique among agents (0..65535)")
      ->check(CLI::Range(0, 65535))
      ->option_text("N");
  bool no_dds = false;
  bool check = false;
  bool print_config = false;
  bool print_memory = false;
  bool print_unit_limits = false;
  app.add_flag("--no-dds", no_dds, "Publish nothing");
  auto* actions = app.add_option_group("instead of running");
  actions->add_flag("--check-config", check, "Check the configuration and exit");
  actions->add_flag("--print-config", print_config, "Print all keys with values and ranges");
  actions->add_flag("--print-memory", print_memory, "Print the memory ledger");
  actions->add_flag("--print-unit-limits", print_unit_limits,
                    "Print the limits that the systemd unit needs for this configuration");
  actions->require_option(0, 1);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return app.exit(e);
    return usage_error(e.what());
  }
  const auto given = [&](const char* name) { return app.count(name) > 0; };
  if (given("--out") && options.out.empty()) return usage_error("--out is empty: name a folder");
  if (given("--config") && options.config_file.empty()) {
    return usage_error("--config is empty: name a TOML file");
  }
  if (given("--state") && options.state.empty()) {
    return usage_error("--state is empty: name a folder, or none");
  }
  options.agent = static_cast<std::uint16_t>(agent);
  options.agent_given = given("--agent");
  options.state_given = given("--state") && options.state != "none";
  if (options.state == "none") options.state.clear();
  options.pace = pace == "fast" ? Options::Pace::kFast : Options::Pace::kRecorded;
  options.dds = !no_dds;
  if (check) options.action = Options::Action::kCheckConfig;
  if (print_config) options.action = Options::Action::kPrintConfig;
  if (print_memory) options.action = Options::Action::kPrintMemory;
  if (print_unit_limits) options.action = Options::Action::kPrintUnitLimits;
  return -1;
}

}  // namespace maplet::daemon
