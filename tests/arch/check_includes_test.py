#!/usr/bin/env python3
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""tools/check_includes must catch each kind of bad include, and let the good ones pass."""
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

CHECK = sys.argv.pop(1)
LICENCE = "// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0\n"
# What there is to include.
HOUSE = ["core/limits.hpp", "core/base/clock.hpp", "core/frame/depth_frame.hpp",
         "core/patches/patch.hpp", "core/patches/extractor.hpp", "core/odometry/tracker.hpp",
         "core/skeleton/graph.hpp", "core/agent/agent.hpp", "core/ports/depth_source.hpp",
         "core/maplet/maplet.hpp", "drivers/sim/world.hpp", "drivers/replay/recording.hpp", "drivers/uri.hpp",
         "transport/exchange/ledger.hpp", "tools/eval/evaluate.hpp", "tests/support/fake.hpp"]


def check(path, include, first=LICENCE):
    """What check_includes prints for a house whose file `path` holds `include`."""
    with tempfile.TemporaryDirectory() as root:
        for name in HOUSE:
            file = Path(root, name)
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(LICENCE)
        file = Path(root, path)
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(first + include + "\n")
        run = subprocess.run([sys.executable, CHECK, root], capture_output=True, text=True, check=False)
        assert run.stderr == "", run.stderr
        assert (run.returncode == 0) == (run.stdout == ""), run
        return run.stdout


class CheckIncludes(unittest.TestCase):
    def refuses(self, path, include, message):
        self.assertIn(f"{path}:2: {message}", check(path, include))

    def accepts(self, path, include):
        self.assertEqual("", check(path, include))

    def test_core_reads_from_left_to_right(self):
        self.accepts("core/odometry/a.cpp", '#include "core/patches/extractor.hpp"')
        self.accepts("core/agent/a.cpp", '#include "core/skeleton/graph.hpp"')
        self.accepts("core/patches/a.cpp", '#include "core/limits.hpp"')
        self.refuses("core/patches/a.cpp", '#include "core/odometry/tracker.hpp"',
                     "core/patches is left of core/odometry")
        self.refuses("core/base/a.hpp", '#include "core/agent/agent.hpp"', "core/base is left of")
        self.refuses("core/magic/a.hpp", '#include "core/base/clock.hpp"', "'magic' is no stage")

    def test_only_the_agent_sees_ports(self):
        self.accepts("core/agent/a.cpp", '#include "core/ports/depth_source.hpp"')
        self.refuses("core/odometry/a.cpp", '#include "core/ports/depth_source.hpp"',
                     "only core/agent sees core/ports")
        self.accepts("core/ports/a.hpp", '#include "core/maplet/maplet.hpp"')
        self.refuses("core/ports/a.hpp", '#include "core/skeleton/graph.hpp"', "a port sees")

    def test_core_knows_nobody_outside(self):
        for header in ("drivers/sim/world.hpp", "transport/exchange/ledger.hpp",
                       "tools/eval/evaluate.hpp", "tests/support/fake.hpp"):
            self.refuses("core/agent/a.cpp", f'#include "{header}"', "core includes only core")

    def test_core_does_no_input_or_output(self):
        for header in ("fstream", "toml++/toml.h", "dds/dds.h", "openni2/OpenNI.h", "thread",
                       "systemd/sd-daemon.h", "unordered_map", "spdlog/spdlog.h"):
            self.assertIn("core/base/a.cpp:2: ", check("core/base/a.cpp", f"#include <{header}>"))
        self.accepts("core/base/a.cpp", "#include <vector>")
        self.accepts("tools/eval/a.cpp", "#include <fstream>")

    def test_drivers_and_transport_see_ports_and_values(self):
        self.accepts("drivers/replay/a.cpp", '#include "core/ports/depth_source.hpp"')
        self.accepts("drivers/replay/a.cpp", '#include "drivers/replay/recording.hpp"')
        self.accepts("transport/dds/a.cpp", '#include "core/maplet/maplet.hpp"')
        self.accepts("transport/dds/a.cpp", '#include "transport/exchange/ledger.hpp"')
        self.refuses("drivers/replay/a.cpp", '#include "core/patches/extractor.hpp"',
                     "drivers/replay/ sees only")
        self.refuses("drivers/replay/a.cpp", '#include "drivers/sim/world.hpp"',
                     "drivers/replay/ sees only")
        self.accepts("drivers/open.cpp", '#include "drivers/sim/world.hpp"')
        self.accepts("drivers/sim/a.cpp", '#include "drivers/uri.hpp"')
        self.refuses("drivers/open.cpp", '#include "core/agent/agent.hpp"', "drivers/ sees only")
        self.refuses("transport/exchange/a.cpp", '#include "core/agent/agent.hpp"',
                     "transport/exchange/ sees only")

    def test_libraries_have_one_home(self):
        for header, home in (("openni2/OpenNI.h", "drivers/openni2"), ("dds/dds.h", "transport/dds"),
                             ("OpenNI.h", "drivers/openni2"), ("gpiod.h", "drivers/gpio"),
                             ("libcamera/libcamera.h", "drivers/libcamera"),
                             ("cairo-svg.h", "tools/draw"), ("systemd/sd-daemon.h", "daemon")):
            self.accepts(f"{home}/a.cpp", f"#include <{header}>")
            self.refuses("tools/mapletctl/a.cpp", f"  #  include <{header}>", f"only {home}")
        self.refuses("transport/exchange/a.cpp", "#include <dds/dds.h>", "only transport/dds")

    def test_daemon_needs_neither_tools_nor_tests(self):
        self.accepts("daemon/a.cpp", '#include "core/agent/agent.hpp"')
        self.refuses("daemon/a.cpp", '#include "tools/eval/evaluate.hpp"', "daemon does not")
        self.refuses("daemon/a.cpp", '#include "tests/support/fake.hpp"', "daemon does not")

    def test_names_start_at_the_root(self):
        self.refuses("core/base/a.cpp", '#include "clock.hpp"', 'name "clock.hpp" from')
        self.refuses("core/base/a.cpp", '#include "../base/clock.hpp"', "name")
        self.refuses("core/base/a.cpp", "#include <core/base/clock.hpp>", "write")
        self.refuses("core/base/a.cpp", '#include "core/base/lost.hpp"', "there is no")
        self.accepts("transport/dds/a.cpp", '#include "maplet_types.h"')

    def test_files_name_their_licence(self):
        self.assertIn("core/base/a.cpp:1: the licence", check("core/base/a.cpp", "int a;", ""))
        self.assertIn("tools/run:2: the licence", check("tools/run", "true", "#!/bin/sh\n"))
        self.assertEqual("", check("tools/run", "true", "#!/bin/sh\n#" + LICENCE[2:]))
        self.assertEqual("", check("tools/notes.md", "words", ""))

    def test_empty_tree_is_no_success(self):
        with tempfile.TemporaryDirectory() as root:
            run = subprocess.run([sys.executable, CHECK, root], capture_output=True, text=True, check=False)
            self.assertEqual(1, run.returncode)
            self.assertIn("no sources", run.stderr)


if __name__ == "__main__":
    unittest.main()
