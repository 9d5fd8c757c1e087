// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

#include "daemon/configure.hpp"
#include "daemon/self_check.hpp"
#include "tools/mapletctl/command.hpp"

namespace maplet::ctl {

namespace {

using daemon::CheckResult;

struct Options {
  daemon::Options daemon;
  bool json = false;
};

void print_json(const std::vector<CheckResult>& results) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const CheckResult& r : results) {
    json.push_back({{"name", r.name},
                    {"result", to_string(r.result)},
                    {"detail", r.detail},
                    {"remedy", r.remedy}});
  }
  fmt::print("{}\n", json.dump());
}

void print(const std::vector<CheckResult>& results) {
  const bool colour = isatty(STDOUT_FILENO) == 1;
  constexpr const char* kColours[] = {"\x1b[32m", "\x1b[33m", "\x1b[31m"};
  for (const CheckResult& r : results) {
    const std::string word =
        fmt::format("{}{:<4}{}", colour ? kColours[static_cast<int>(r.result)] : "",
                    to_string(r.result), colour ? "\x1b[0m" : "");
    fmt::print("{}  {:<14} {}\n", word, r.name, r.detail);
    if (!r.remedy.empty()) fmt::print("      {:<14} -> {}\n", "", r.remedy);
  }
}

void run(const Options& options) {
  std::vector<CheckResult> results;
  const auto config = daemon::configure(options.daemon);
  if (config) {
    results.push_back(
        {"configuration", CheckResult::Result::kOk,
         options.daemon.config_file.empty() ? "the defaults" : options.daemon.config_file, ""});
    const auto found = daemon::self_check(*config, options.daemon.state);
    results.insert(results.end(), found.begin(), found.end());
  } else {
    results.push_back({"configuration", CheckResult::Result::kFail, config.error(),
                       "correct it; mapletd --print-config lists all keys"});
  }
  options.json ? print_json(results) : print(results);
  const auto failed = std::count_if(results.begin(), results.end(), [](const CheckResult& r) {
    return r.result == CheckResult::Result::kFail;
  });
  std::fflush(stdout);
  if (failed > 0) throw Failure{fmt::format("{} of {} checks failed", failed, results.size())};
}

}  // namespace

void add_check(Command app) {
  auto options = std::make_shared<Options>();
  const Command sub = app.add_command(
      "check",
      "What mapletd will find on this machine: camera, permissions, GPIO, clock, network, "
      "peers, memory, real time; a line each with the remedy");
  sub.add_option("--config", options->daemon.config_file, "TOML file, as mapletd takes it");
  sub.add_option("--set", options->daemon.overrides, "key=value over the file").one_each();
  sub.add_option("--source", options->daemon.source, "source URI, as mapletd takes it");
  sub.add_option("--state", options->daemon.state,
                 "folder of its journal, as mapletd takes it: new keys are kept there")
      .type_name("DIR");
  sub.add_flag("--json", options->json, "the results, as JSON");
  sub.run([options] { run(*options); });
}

}  // namespace maplet::ctl
