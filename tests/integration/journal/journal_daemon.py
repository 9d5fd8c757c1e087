# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""What tests of the journal share: a daemon with a state folder, and its mission."""
import json
import os
import subprocess
import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[2] / "support"))
import daemon  # noqa: E402

ROOM = "sim:room?seed=3&width=160&frames=400"


class JournalTest(daemon.DaemonTest):
    def state(self):
        return self.file("state")

    def run_service(self, *more, environment=None, source=ROOM, wrapper=()):
        if os.path.exists(self.file("socket")):
            os.remove(self.file("socket"))
        self.start("--source", source, "--state", self.state(), "--set", "journal.size_mib=8", *more,
                   environment=environment, wrapper=wrapper)
        self.until(lambda: os.path.exists(self.file("socket")))

    def journal(self):
        return self.status()["journal"]

    def until_flushed(self, maplets):
        self.until(lambda: self.journal()["flushed"].get("maplets", 0) >= maplets)

    def mission(self, *words):
        done = subprocess.run([str(daemon.BIN / "mapletctl"), "mission", *words], text=True,
                              capture_output=True, timeout=daemon.PATIENCE_S)
        return done.returncode, done.stdout, done.stderr

    def listed(self, folder=None):
        code, said, wrong = self.mission("list", "--json", "--state", folder or self.state())
        self.assertEqual(code, 0, wrong)
        return json.loads(said)

    def fill(self, source=ROOM):
        """A mission of a whole run, ended in order. @return what is listed of it"""
        self.run_service(source=source)
        self.until_flushed(3)
        self.assertEqual(self.stop()[0], 0)
        return self.listed()
