#!/usr/bin/env python3
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""The journal's figures on a quiet machine (docs/benchmarks.md): how long a start with 512 maplets takes,
what is written, what a disk that stalls costs a frame."""
import json
import os
import re
import statistics
import subprocess
import sys
import time
import unittest
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "support"))
import daemon  # noqa: E402

WIDTH = int(os.environ.get("MAPLET_WIDTH", "640"))
STARTS = int(os.environ.get("MAPLET_STARTS", "10"))
RUN_S = float(os.environ.get("MAPLET_RUN_S", "120"))
DISK = os.environ.get("MAPLET_DISK_LIBRARY", "")
# Maplets as short as can be.
MANY = ["odometry.keyframe_distance_m=0.1", "maplet.max_path_m=0.1", "maplet.max_yaw_rad=0.1",
        "maplet.max_keyframes=2", "maplet.overlap_keyframes=1", "maplet.boundary_keyframes=0"]
LOOP = f"sim:loop?seed=7&width={WIDTH}"


def say(text):
    print(text, file=sys.stderr, flush=True)


class Figures(daemon.DaemonTest):
    def state(self):
        return self.file("state")

    def begin(self, *more, source=LOOP, environment=None):
        """@return s until READY"""
        if os.path.exists(self.file("socket")):
            os.remove(self.file("socket"))
        self.heard = []
        begin = time.monotonic()
        self.start("--source", source, *more, environment=environment)
        self.until(lambda: self.count("READY=1") > 0)
        return time.monotonic() - begin

    def end(self):
        return self.stop()[2]

    def run_for(self, duration_s):
        """Listens meanwhile: who notifies and is not heard waits."""
        end = time.monotonic() + duration_s
        self.until(lambda: time.monotonic() > end, duration_s + 60)

    def listed(self):
        done = subprocess.run([str(daemon.BIN / "mapletctl"), "mission", "list", "--json", "--state",
                               self.state()], capture_output=True, text=True, check=True)
        return json.loads(done.stdout)

    def test_resume(self):
        many = [word for setting in MANY for word in ("--set", setting)]
        subprocess.run([str(daemon.BIN / "mapletd"), "--no-dds", "--source", f"{LOOP}&frames=3600",
                        "--out", self.file("out"), "--state", self.state(), *many], check=True,
                       capture_output=True, timeout=900)
        listed = self.listed()
        self.assertGreaterEqual(listed["maplets"], 512)
        resumed, ready, without = [], [], []
        for _ in range(STARTS):
            ready.append(self.begin("--state", self.state()))
            said = self.end()
            found = re.search(r"resumed (\d+) maplet\(s\).* in (\d+) ms", said)
            self.assertEqual(int(found[1]), 512)
            resumed.append(int(found[2]))
            without.append(self.begin())
            self.end()
        bytes_each = sum(p.stat().st_size for p in Path(self.file("out"), "maplets").iterdir())
        say(f"{listed['maplets']} maplets of {bytes_each / listed['maplets']:.0f} bytes, "
            f"{listed['bytes']} bytes of the store; resume, of {STARTS} starts: median "
            f"{statistics.median(resumed)} ms, longest {max(resumed)} ms; until READY "
            f"{1e3 * statistics.median(ready):.0f} ms, without a journal "
            f"{1e3 * statistics.median(without):.0f} ms")
        self.assertLess(max(resumed), 500)

    def test_bytes_written(self):
        self.begin("--state", self.state(), "--pace", "recorded")
        begin = time.monotonic()
        self.run_for(RUN_S)
        io = Path(f"/proc/{self.daemon.pid}/io").read_text(encoding="utf-8")
        by_kernel = int(re.search(r"^write_bytes: (\d+)", io, re.M)[1])
        minutes = (time.monotonic() - begin) / 60
        status = self.status()["journal"]
        self.end()
        allowed = 1.3 * status["record_bytes"] + 16 * 1024 * minutes
        say(f"{60 * minutes:.0f} s: {status['record_bytes']} bytes of records and maplets, "
            f"{status['written_bytes']} written in {status['flushes']} turns (allowed: "
            f"{allowed:.0f}); the kernel counts {by_kernel} for the process")
        self.assertGreater(status["record_bytes"], 0)
        self.assertLess(status["written_bytes"], allowed)

    @unittest.skipUnless(DISK, "no mocked disk")
    def test_a_disk_that_stalls(self):
        worst = {}
        for mood in ("", "s"):
            Path(self.file("mood")).write_text(mood, encoding="utf-8")
            self.begin("--state", self.file("state" + mood), "--pace", "recorded", environment={
                "LD_PRELOAD": DISK, "MAPLET_DISK": self.file("mood")})
            self.run_for(RUN_S / 2)
            status = self.status()
            worst[mood] = status["stages"]
            say(f"{'2 s stalls' if mood else 'no stalls'}: {status['journal']['flushes']} turns, "
                f"handing over {status['stages']['exchange']}, frame {status['stages']['frame']}, "
                f"latency {status.get('latency')}")
            self.end()


if __name__ == "__main__":
    unittest.main()
