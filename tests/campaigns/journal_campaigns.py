#!/usr/bin/env python3
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""The journal under kills, cuts and flipped bits: nothing acknowledged is lost, every start works.
How many: MAPLET_KILLS, MAPLET_CUTS, MAPLET_FLIPS; the seed: MAPLET_SEED; MAPLET_PACE=recorded takes
little of the processor."""
import json
import os
import random
import shutil
import socket
import subprocess
import sys
import threading
import time
import unittest
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "support"))
import daemon  # noqa: E402

KILLS = int(os.environ.get("MAPLET_KILLS", "10"))
CUTS = int(os.environ.get("MAPLET_CUTS", "10"))
FLIPS = int(os.environ.get("MAPLET_FLIPS", "10"))
SEED = int(os.environ.get("MAPLET_SEED", "1"))
PACE = os.environ.get("MAPLET_PACE", "fast")
STREAMS = ("delta_poses", "closures", "ranges", "maplets")


class Campaign(daemon.DaemonTest):
    def setUp(self):
        super().setUp()
        self.random = random.Random(SEED)
        self.state = self.file("state")
        # Somebody has to read what the daemons notify, or the kernel's short queue holds them up.
        threading.Thread(target=self.read_notices, args=(self.notify,), daemon=True).start()

    @staticmethod
    def read_notices(notify):
        while True:
            try:
                notify.recv(4096)
            except TimeoutError:
                pass
            except OSError:  # closed: the test is over
                return

    def launch(self, frames=1500):
        if os.path.exists(self.file("socket")):
            os.remove(self.file("socket"))
        seed = self.random.randrange(1000)
        rate_hz = 30 if PACE == "fast" else 90
        self.start("--source", f"sim:room?seed={seed}&width=160&frames={frames}&rate_hz={rate_hz}",
                   "--state", self.state, "--pace", PACE, "--set", "journal.size_mib=4", "--set",
                   "limits.own_maplets=64")

    def ask(self, patience_s=daemon.PATIENCE_S):
        """The daemon's status; None when it is gone."""
        end = time.monotonic() + patience_s
        while time.monotonic() < end:
            try:
                with socket.socket(socket.AF_UNIX) as s:
                    s.settimeout(5)
                    s.connect(self.file("socket"))
                    s.sendall(b'{"command":"status"}\n')
                    with s.makefile() as answer:
                        return json.loads(answer.readline())
            except OSError:
                if self.daemon.poll() is not None:
                    return None
                time.sleep(0.005)
        return None

    def listed(self, folder):
        done = subprocess.run([str(daemon.BIN / "mapletctl"), "mission", "list", "--json",
                               "--state", folder], capture_output=True, text=True, timeout=60)
        self.assertIn(done.returncode, (0, 1), done.stderr)
        return json.loads(done.stdout) if done.returncode == 0 else None

    def end(self):
        ended, self.daemon = self.daemon, None
        ended.kill()
        return ended.communicate()[1]

    def expect(self, listed, safe):
        self.assertIsNotNone(listed)
        for stream in STREAMS:
            self.assertGreaterEqual(listed["flushed"][stream], safe.get(stream, 0))
        self.assertEqual({s: listed["missing"][s] for s in STREAMS}, {s: 0 for s in STREAMS})

    def until_something_is_safe(self):
        """@return after how many seconds, so that kills come before, at and after it"""
        self.launch()
        begin = time.monotonic()
        while self.ask()["journal"]["flushed"].get("maplets", 0) == 0:
            self.assertLess(time.monotonic() - begin, daemon.PATIENCE_S, "nothing gets safe")
            time.sleep(0.05)
        self.end()
        return time.monotonic() - begin

    def test_kills(self):
        longest_s = max(6.0, 2.5 * self.until_something_is_safe())
        safe = self.listed(self.state)["flushed"]
        grown = 0
        for kill in range(KILLS):
            self.launch()
            status = self.ask()
            self.assertIsNotNone(status, f"start {kill} failed: {self.daemon.poll()}")
            end = time.monotonic() + self.random.uniform(0.0, longest_s)
            while time.monotonic() < end:
                status = self.ask(1.0) or status
                time.sleep(0.02)
            self.assertEqual(status["journal"]["state"], "on")
            now = status["journal"]["flushed"]
            grown += now.get("maplets", 0) > safe.get("maplets", 0)
            safe = now
            self.end()
            self.expect(self.listed(self.state), safe)
            if (kill + 1) % 50 == 0 or kill + 1 == KILLS:
                print(f"{kill + 1} kills, {grown} with something new; flushed {safe}",
                      file=sys.stderr, flush=True)
        self.assertGreater(grown, KILLS // 5)

    def a_mission(self):
        self.launch()
        while True:  # enough, or the source is over
            status = self.ask()
            self.assertIsNotNone(status)
            if status["maplets"] >= 40 or status["frames"]["processed"] >= 1500:
                break
            time.sleep(0.05)
        self.daemon.terminate()
        self.daemon.communicate()
        listed = self.listed(self.state)
        self.assertGreater(listed["maplets"], 5)
        shutil.copytree(self.state, self.file("good"))
        return listed

    def damaged(self, change):
        """A start on a damaged copy works. @return what is listed of the copy, what was said"""
        shutil.rmtree(self.state)
        shutil.copytree(self.file("good"), self.state)
        change(os.path.join(self.state, "mission.journal"))
        listed = self.listed(self.state)
        self.launch(frames=2)
        self.assertIsNotNone(self.ask(), f"start failed: {self.daemon.poll()}")
        return listed, self.end()

    def test_cuts(self):
        whole = self.a_mission()
        for cut in range(CUTS):
            if cut % 50 == 49:
                print(f"{cut} cuts", file=sys.stderr, flush=True)
            size = self.random.randrange(whole["bytes"])
            listed, said = self.damaged(lambda path, size=size: os.truncate(path, size))
            if listed is None:  # not even the first turn is there
                self.assertLess(size, 70_000)
                continue
            # Turns that end before the cut are there: at most a turn's bytes are not.
            self.assertLess(size - listed["bytes"], 24 * 4096)
            self.assertEqual(sum(listed["missing"].values()), 0)
            self.assertIn("too short", listed["damage"])
            self.assertIn("too short", said)

    def test_flips(self):
        whole = self.a_mission()
        mended = 0
        for flip_number in range(FLIPS):
            at = self.random.randrange(whole["bytes"])
            bit = 1 << self.random.randrange(8)

            def flip(path, at=at, bit=bit):
                with open(path, "r+b") as file:
                    file.seek(at)
                    octet = file.read(1)[0]
                    file.seek(at)
                    file.write(bytes([octet ^ bit]))

            listed, said = self.damaged(flip)
            self.expect(listed, whole["flushed"])
            self.assertEqual(listed["records"], whole["records"])
            if listed["damage"]:
                mended += 1
                self.assertIn("set right", said)
            if (flip_number + 1) % 50 == 0 or flip_number + 1 == FLIPS:
                print(f"{flip_number + 1} flips, {mended} in what counts", file=sys.stderr,
                      flush=True)


if __name__ == "__main__":
    unittest.main()
