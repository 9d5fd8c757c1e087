#!/usr/bin/env python3
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""The production daemon with a camera that fails: the real OpenNI2 runtime, a synthetic driver
(openni2_synth/script.hpp), the service as it runs on a robot."""
import os
import random
import sys
import time
import unittest
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "support"))
import daemon  # noqa: E402

RUNTIME = os.environ["MAPLET_SYNTH_RUNTIME"]
SMALL = ["--set", "camera.width_px=320", "--set", "camera.height_px=240", "--set",
         "camera.fx_px=285", "--set", "camera.fy_px=285", "--set", "camera.cx_px=159.5",
         "--set", "camera.cy_px=119.5"]
RETURN_S = 2.0  # after the device is back


class Camera(daemon.DaemonTest):
    def start(self, script, *more):
        super().start("--source", "openni2:", *SMALL, *more, environment={
            "LD_LIBRARY_PATH": RUNTIME,
            "MAPLET_SYNTH": f"world=room sim.seed=3 sim.frames=100000 rate_hz=30 {script}"})
        self.until(lambda: os.path.exists(self.file("socket")))

    def processed(self):
        return self.status()["frames"]["processed"]

    def flows(self):
        """Frames come: five more than now."""
        before = self.processed()
        self.until(lambda: self.processed() >= before + 5)

    def ends_well(self):
        status = self.status()
        # Under a sanitizer nobody counts.
        self.assertIn(status["memory"]["heap_allocations_after_ready"], (0, None))
        code, _, said = self.stop()
        self.assertEqual(code, 0, said)
        return said

    def test_a_camera_that_comes_later(self):
        self.start("absent=1 absent_ms=4000")
        self.until(lambda: self.status()["state"] == "waiting_for_camera")
        self.until(lambda: self.status()["state"] == "running")
        self.flows()
        self.assertIn("waiting for a camera", self.ends_well())

    def test_unplugged_in_mid_run(self):
        self.start("fault=unplug@60:3000")
        self.until(lambda: self.status()["state"] == "waiting_for_camera")
        maplets = self.status()["maplets"]
        begin = time.monotonic()
        self.until(lambda: self.status()["state"] == "running")
        self.flows()
        self.assertLess(time.monotonic() - begin, 3.0 + 2 * RETURN_S)  # the bar is measured alone
        self.assertGreaterEqual(self.status()["maplets"], maplets)
        self.ends_well()

    def test_a_stall_is_no_end(self):
        self.start("fault=stall@40:2500")
        self.until(lambda: self.processed() >= 60)
        self.ends_well()

    def test_a_camera_that_falls_silent_is_opened_anew(self):
        self.start("silent=40")
        self.until(lambda: self.processed() >= 60)  # the second opening
        self.ends_well()

    def test_black_frames_lose_the_track_and_give_it_back(self):
        self.start("fault=black@40:30")
        self.until(lambda: self.status()["tracking"]["lost"] > 0)
        self.until(lambda: self.status()["tracking"]["now"])
        self.flows()
        self.ends_well()

    def test_damaged_frames_are_counted(self):
        self.start("fault=corrupt@30:3 fault=mode@40:3 fault=duplicate@50 fault=backwards@60:200 "
                   "fault=late@70:150 fault=burst@80:5")
        self.until(lambda: self.processed() >= 100)
        self.ends_well()

    def test_colour_that_is_lost(self):
        self.start("fault=no_colour@30:60")
        self.until(lambda: self.processed() >= 110)
        self.assertTrue(self.status()["tracking"]["now"])
        self.ends_well()

    def test_a_camera_of_another_size_is_refused_with_both_named(self):
        super().start("--source", "openni2:", "--set", "camera.width_px=160", "--set",
                      "camera.height_px=120", "--set", "camera.fx_px=140", "--set",
                      "camera.fy_px=140", environment={"LD_LIBRARY_PATH": RUNTIME,
                                                       "MAPLET_SYNTH": "world=room"})
        _, said = self.daemon.communicate(timeout=daemon.PATIENCE_S)
        self.assertEqual(self.daemon.returncode, 1)
        self.assertIn("160x120", said)
        self.assertIn("320x240", said)

    def test_random_scripts(self):
        # MAPLET_FAULT_SCRIPTS=200 is the campaign (docs/testing.md).
        kinds = ["stall@{}:300", "unplug@{}:200", "late@{}:100", "duplicate@{}", "burst@{}:4",
                 "black@{}:8", "corrupt@{}:3", "mode@{}:3", "no_colour@{}:10", "backwards@{}:100"]
        for seed in range(int(os.environ.get("MAPLET_FAULT_SCRIPTS", "2"))):
            dice = random.Random(seed)
            faults = [dice.choice(kinds).format(dice.randrange(10, 200)) for _ in range(6)]
            with self.subTest(seed=seed, faults=faults):
                self.start("rate_hz=100 " + " ".join(f"fault={fault}" for fault in faults))
                self.until(lambda: self.status()["frames"]["read"] >= 230)
                self.until(lambda: self.status()["tracking"]["now"])
                self.ends_well()


if __name__ == "__main__":
    unittest.main(verbosity=2)
