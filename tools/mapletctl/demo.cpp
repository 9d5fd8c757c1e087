// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <memory>

#include "tools/mapletctl/command.hpp"

namespace maplet::ctl {

namespace {

namespace fs = std::filesystem;

/// The script lies beside the programs' folder, installed or built: ../libexec/mapletd/demo.
void run(const std::string& out) {
  std::error_code error;
  const fs::path bin = fs::read_symlink("/proc/self/exe", error).parent_path();
  const fs::path script = bin.parent_path() / "libexec/mapletd/demo";
  if (!fs::exists(script, error)) {
    throw Failure{fmt::format("{}: missing; it is installed beside mapletctl", script.string())};
  }
  const fs::path absolute = fs::absolute(out, error);
  execl("/bin/bash", "bash", script.c_str(), bin.c_str(), absolute.c_str(), nullptr);
  throw Failure{fmt::format("/bin/bash: {}; install bash", std::strerror(errno))};
}

}  // namespace

void add_demo(Command app) {
  auto out = std::make_shared<std::string>("mapletd-demo");
  const Command sub = app.add_command(
      "demo",
      "Two daemons map a simulated building from different places, lose each other, meet and merge "
      "their maps: a table of PASS and FAIL, and pictures before and after. A minute and a half");
  sub.add_option("--out", *out, "folder for all of it; an earlier demo's is replaced")
      .type_name("DIR")
      .show_default();
  sub.run([out] { run(*out); });
}

}  // namespace maplet::ctl
