// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>

#include "tools/mapletctl/command.hpp"

namespace maplet::ctl {

void add_version(Command app) {
  app.add_command("version", "Prints the version").run([] {
    fmt::print("mapletctl " MAPLET_VERSION "\n");
  });
}

}  // namespace maplet::ctl
