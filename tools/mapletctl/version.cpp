// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>

#include "tools/mapletctl/command.hpp"

namespace maplet::ctl {

void add_version(CLI::App& app) {
  app.add_subcommand("version", "Prints the version")->callback([] {
    fmt::print("mapletctl " MAPLET_VERSION "\n");
  });
}

}  // namespace maplet::ctl
