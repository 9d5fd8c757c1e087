#!/usr/bin/env python3
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""What the flight recorder holds replays bit for bit, decisions that depended on time included; what
differs is named. MAPLET_FLIGHTS random missions."""
import json
import os
import random
import subprocess
import sys
import unittest
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[2] / "support"))
import daemon  # noqa: E402

FLIGHTS = int(os.environ.get("MAPLET_FLIGHTS", "3"))
SEED = int(os.environ.get("MAPLET_SEED", "1"))


class Recorder(daemon.DaemonTest):
    def run_to(self, out, *arguments):
        done = subprocess.run([str(daemon.BIN / "mapletd"), "--no-dds", "--out", self.file(out),
                               *arguments], capture_output=True, text=True, timeout=300)
        self.assertEqual(done.returncode, 0, done.stderr)
        return json.loads(Path(self.file(out), "report.json").read_text(encoding="utf-8"))

    def diff(self, a, b):
        done = subprocess.run([str(daemon.BIN / "mapletctl"), "diff", self.file(a), self.file(b),
                               "--json"], capture_output=True, text=True, timeout=60)
        return json.loads(done.stdout)

    def fly(self, source, *more):
        record = "recorder.file=" + self.file("flight")
        return self.run_to("a", "--source", source, "--set", record, "--set",
                           "control.socket=none", *more)

    def replay(self, out, *more):
        return self.run_to(out, "--source", "record:" + self.file("flight"), *more)

    def test_missions_under_pressure_replay_bit_for_bit(self):
        dice = random.Random(SEED)
        degraded = 0
        for _ in range(FLIGHTS):
            world = dice.choice(["room", "loop", "corridor"])
            source = (f"sim:{world}?seed={dice.randrange(1000)}&width=320"
                      f"&frames={dice.randrange(100, 200)}")
            budget = dice.choice([1500, 2500, 4000])
            report = self.fly(source, "--pace", "recorded", "--set", f"frame.budget_us={budget}")
            degraded += report["frames"]["processed"] < report["frames"]["read"] or \
                report["stages"]["frame"]["deadline_misses"] > 0
            again = self.replay("b")
            self.assertEqual(self.diff("a", "b"), {"equal": True, "first": None}, source)
            self.assertEqual(again["maplets"], report["maplets"])
        self.assertGreater(degraded, 0, "nothing was under pressure")

    def test_a_fast_run_replays_too(self):
        self.fly("sim:room?seed=3&width=160&frames=150")
        self.replay("b")
        self.assertTrue(self.diff("a", "b")["equal"])

    def test_the_first_frame_and_stage_that_differ_are_named(self):
        self.fly("sim:room?seed=3&width=160&frames=100")
        self.replay("b", "--set", "patches.max_patches=40")
        found = self.diff("a", "b")
        self.assertFalse(found["equal"])
        self.assertEqual((found["first"]["frame"], found["first"]["stage"]), (0, "patches"))
        self.replay("c", "--set", "maplet.max_keyframes=5")
        found = self.diff("a", "c")
        self.assertFalse(found["equal"])
        self.assertNotEqual(found["first"]["stage"], "patches")

    def test_a_service_is_saved_while_it_runs(self):
        self.start("--source", "sim:room?seed=3&width=160&frames=100000", "--set",
                   "recorder.file=" + self.file("ring"))
        self.until(lambda: os.path.exists(self.file("socket")) and self.status()["maplets"] > 2)
        code, _, wrong = self.ctl("recorder", "save", "--out", self.file("flight"))
        self.assertEqual(code, 0, wrong)
        self.stop()
        self.replay("b")
        self.replay("c")
        self.assertTrue(self.diff("b", "c")["equal"])

    def test_without_a_recorder_it_is_said(self):
        self.start("--source", "sim:room?seed=3&width=160&frames=100")
        self.until(lambda: os.path.exists(self.file("socket")))
        code, _, wrong = self.ctl("recorder", "save", "--out", self.file("flight"))
        self.assertEqual(code, 1)
        self.assertIn("recorder.file", wrong)

    def test_what_is_no_record_is_refused(self):
        Path(self.file("flight")).write_bytes(b"nothing" * 100)
        done = subprocess.run([str(daemon.BIN / "mapletd"), "--no-dds", "--out", self.file("x"),
                               "--source", "record:" + self.file("flight")], capture_output=True,
                              text=True, timeout=60)
        self.assertIn(done.returncode, (1, 2))
        self.assertIn("no flight recorder's file", done.stderr)


if __name__ == "__main__":
    unittest.main()
