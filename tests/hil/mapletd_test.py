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
SANITIZED = "MAPLET_SANITIZED" in os.environ  # ten times slower, and nobody counts allocations
WELL = ("running", "degraded")  # the machine may be busy


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
        self.assertEqual(status["memory"]["heap_allocations_after_ready"], None if SANITIZED else 0)
        code, _, said = self.stop()
        self.assertEqual(code, 0, said)
        return said

    def test_a_camera_that_comes_later(self):
        self.start("absent=1 absent_ms=4000")
        self.until(lambda: self.status()["state"] == "waiting_for_camera")
        self.until(lambda: self.status()["state"] in WELL)
        self.flows()
        self.assertIn("waiting for a camera", self.ends_well())

    def test_unplugged_in_mid_run(self):
        self.start("fault=unplug@150:10000")
        self.until(lambda: self.status()["state"] == "waiting_for_camera")
        begin = time.monotonic()
        maplets = self.status()["maplets"]
        self.assertGreater(maplets, 0)
        self.until(lambda: self.status()["state"] in WELL)
        self.flows()
        after = time.monotonic() - begin - 10.0
        print(f"frames flow {after:.2f} s after the camera's return", flush=True)
        self.assertLess(after, 2 * RETURN_S)  # the bar is measured alone
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
        self.start("fault=black@150:150")  # 5 s
        self.until(lambda: self.status()["tracking"]["lost"] > 0)
        maplets = self.status()["maplets"]
        self.assertGreater(maplets, -1 if SANITIZED else 0)
        self.until(lambda: self.read_frames() >= 305)
        self.until(lambda: self.status()["tracking"]["now"])
        self.assertGreaterEqual(self.status()["maplets"], maplets)
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

    def test_a_gray_camera_that_is_not_there(self):
        self.start("", "--set", "gray_camera.source=libcamera:no-such-camera", "--set",
                   "gray_camera.fx_px=500", "--set", "gray_camera.fy_px=500")
        self.flows()
        gray = self.status()["gray_camera"]
        self.assertFalse(gray["running"])
        self.assertEqual(gray["paired"], 0)
        self.assertGreater(gray["alone"], 0)
        self.assertIn("depth goes on alone", gray["detail"])
        time.sleep(2.5)  # it is looked for again and again, and said once
        self.flows()
        self.assertEqual(self.ends_well().count("depth goes on alone"), 1)

    def test_two_cameras_that_call_themselves_the_same(self):
        super().start("--source", "openni2:", *SMALL, environment={
            "LD_LIBRARY_PATH": os.environ["MAPLET_TWINS_RUNTIME"], "MAPLET_SYNTH": "world=room"})
        _, said = self.daemon.communicate(timeout=daemon.PATIENCE_S)
        self.assertEqual(self.daemon.returncode, 1)
        self.assertIn("2 devices call themselves synth://camera", said)

    def test_frames_come_soon_and_take_no_memory(self):
        # Under SCHED_FIFO, where the kernel grants it: the bar is p99 <= 1 ms on a machine of its own.
        self.start("sim.noise=0", "--set", "realtime.capture_priority=40", "--set",
                   "realtime.estimator_priority=30", "--set", "input.decimate=2")
        self.flows()
        first = self.status()
        self.until(lambda: self.processed() >= int(os.environ.get("MAPLET_LATENCY_FRAMES", "150")))
        last = self.status()
        print("latency", last["latency"], flush=True)
        self.assertGreater(last["latency"]["p50_us"], 0)
        self.assertLess(last["latency"]["p50_us"], 5000)  # loose: others work here, too
        if SANITIZED:
            return
        frames = sum(last["frames"][kind] - first["frames"][kind] for kind in ("read", "dropped"))
        theirs = (last["memory"]["third_party_allocations"] -
                  first["memory"]["third_party_allocations"])
        print(f"{theirs} allocations of OpenNI2 on the capture thread for {frames} frames",
              flush=True)
        # OpenNI2's own, 92 a frame when this was written; hil_openni2 shows that none of ours is
        # among them.
        self.assertLessEqual(theirs, 120 * frames + 120)
        self.ends_well()

    def test_random_scripts(self):
        # MAPLET_FAULT_SCRIPTS=200 MAPLET_FAULT_FRAMES=900 is the campaign: 30 s of frames each, at
        # 150 a second (docs/testing.md).
        frames = int(os.environ.get("MAPLET_FAULT_FRAMES", "230"))
        kinds = ["stall@{}:300", "unplug@{}:200", "late@{}:100", "duplicate@{}", "burst@{}:4",
                 "black@{}:8", "corrupt@{}:3", "mode@{}:3", "no_colour@{}:10", "backwards@{}:100"]
        first = int(os.environ.get("MAPLET_FAULT_FIRST", "0"))
        for seed in range(first, first + int(os.environ.get("MAPLET_FAULT_SCRIPTS", "2"))):
            dice = random.Random(seed)
            faults = [dice.choice(kinds).format(dice.randrange(10, frames - 30))
                      for _ in range(6 * frames // 230)]
            with self.subTest(seed=seed, faults=faults):
                self.start("rate_hz=150 " + " ".join(f"fault={fault}" for fault in faults), "--set",
                           "input.decimate=2")
                self.until(lambda: self.read_frames() >= frames // 2)
                half = self.status()
                self.until(lambda: self.read_frames() >= frames - 20)
                self.until(lambda: self.status()["tracking"]["now"])
                last = self.status()
                grown = last["memory"]["rss_bytes"] - half["memory"]["rss_bytes"]
                self.assertLess(grown, (64 if SANITIZED else 16) << 20)  # pages of the arena that the map first touches
                self.assertGreaterEqual(last["maplets"], half["maplets"])
                self.ends_well()
                print(seed, "rss", last["memory"]["rss_bytes"], "grown", grown, flush=True)

    def read_frames(self):
        return self.status()["frames"]["read"]


if __name__ == "__main__":
    unittest.main(verbosity=2)
