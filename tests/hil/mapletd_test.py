#!/usr/bin/env python3
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""The production daemon with a camera that fails: the real OpenNI2 runtime, a synthetic driver
(openni2_synth/script.hpp), the service as it runs on a robot."""
import os
import random
import sys
import threading
import time
import unittest
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "support"))
import daemon  # noqa: E402

RUNTIME = os.environ["MAPLET_SYNTH_RUNTIME"]
SMALL = ["--set", "camera.width_px=320", "--set", "camera.height_px=240", "--set",
         "camera.fx_px=285", "--set", "camera.fy_px=285", "--set", "camera.cx_px=159.5",
         "--set", "camera.cy_px=119.5"]
CAMPAIGN = "MAPLET_FAULT_SCRIPTS" in os.environ  # the machine has nothing else to do
# As on a robot: a machine that is loaded by others tells of these others.
PRIORITY = ["--set", "realtime.estimator_priority=20", "--set",
            "realtime.capture_priority=30"] if CAMPAIGN else []
RETURN_S = 2.0 if CAMPAIGN else 20.0  # after the device is back: the bar, and on a busy machine
SANITIZED = "MAPLET_SANITIZED" in os.environ  # ten times slower, and nobody counts allocations
FLAT_BYTES = 1 << 17  # of resident memory, in a dozen returns
SCRIPT_BYTES = 8 << 20  # in half a script: a camera's first returns, whose driver makes a world each
KINDS = ["stall@{}:300", "unplug@{}:200", "late@{}:100", "duplicate@{}", "burst@{}:4", "black@{}:8",
         "corrupt@{}:3", "mode@{}:3", "no_colour@{}:10", "backwards@{}:100"]
WELL = ("running", "degraded")  # the machine may be busy


class Camera(daemon.DaemonTest):
    def start(self, script, *more):
        if self.daemon is not None and self.daemon.poll() is None:
            self.daemon.kill()  # of a script that failed: it would slow down the next
            self.daemon.communicate()
        super().start("--source", "openni2:", *SMALL, *more, environment={
            "LD_LIBRARY_PATH": RUNTIME,
            "MAPLET_SYNTH": f"world=room sim.seed=3 sim.frames=100000 rate_hz=30 {script}"})
        self.until(lambda: os.path.exists(self.file("socket")))

    def maplets(self):
        """Keys of all maplets that the daemon shows."""
        return {(one["agent"], one["id"]) for one in self.ask({"command": "maplets"})}

    def processed(self):
        return self.status()["frames"]["processed"]

    def flows(self):
        """Frames come: five more than now."""
        before = self.processed()
        self.until(lambda: self.processed() >= before + 5)

    def watch(self):
        """Looks twenty times a second, until stop_watching(): (monotonic time, status)."""
        self.seen, self.watching = [], True

        def look():
            while self.watching:
                self.seen.append((time.monotonic(), self.ask({"command": "status"})))
                time.sleep(0.05)
        self.watcher = threading.Thread(target=look)
        self.watcher.start()

    def stop_watching(self):
        self.watching = False
        self.watcher.join()

    def fault_log(self):
        """What the camera did: [(monotonic time, begins|over, kind)]."""
        lines = Path(self.file("faults")).read_text(encoding="utf-8").split("\n")[:-1]
        return [(float(time_s), what, kind) for time_s, what, kind in map(str.split, lines)]

    def recovery_s(self, since, tracked):
        """From then on until a frame is processed, and with `tracked` the camera is tracked."""
        before = max((status["frames"]["processed"] for at, status in self.seen if at <= since),
                     default=0)
        for at, status in self.seen:
            if at > since and status["frames"]["processed"] > before and (
                    not tracked or status["tracking"]["now"]) and status["state"] in WELL:
                return at - since
        return float("inf")

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
        maplets = self.maplets()
        self.assertTrue(maplets)
        self.until(lambda: self.status()["state"] in WELL)
        self.flows()
        after = time.monotonic() - begin - 10.0
        print(f"frames flow {after:.2f} s after the camera's return", flush=True)
        self.assertLess(after, RETURN_S)
        self.assertLessEqual(maplets, self.maplets())
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
        self.until(lambda: self.read_frames() >= 150 and self.status()["tracking"]["lost"] > 0)
        maplets = self.maplets()
        self.assertGreater(len(maplets), -1 if SANITIZED else 0)
        self.until(lambda: self.read_frames() >= 305)
        self.until(lambda: self.status()["tracking"]["now"])
        self.assertLessEqual(maplets, self.maplets())
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
        before = self.status()
        first = self.status()
        asked = 0

        def seen_enough():
            nonlocal asked
            asked += 1
            time.sleep(1)
            return self.processed() >= int(os.environ.get("MAPLET_LATENCY_FRAMES", "150"))

        self.until(seen_enough)
        last = self.status()
        print("latency", last["latency"], flush=True)
        self.assertGreater(last["latency"]["p50_us"], 0)
        self.assertLess(last["latency"]["p50_us"], 5000)  # loose: others work here, too
        if SANITIZED:
            return
        frames = sum(last["frames"][kind] - first["frames"][kind] for kind in ("read", "dropped"))
        made = [one["memory"]["third_party_allocations"] for one in (before, first, last)]
        # A status is made on a thread that may allocate, too, and makes most of them.
        theirs = made[2] - made[1] - (asked + 1) * (made[1] - made[0])
        print(f"{theirs} allocations of OpenNI2 on the capture thread for {frames} frames",
              flush=True)
        # OpenNI2's own, two a frame when this was written; hil_openni2 shows that none of ours is
        # among them.
        self.assertLessEqual(theirs, 20 * frames + 200)
        self.ends_well()

    def test_every_kind_of_fault_is_over_soon(self):
        # One after the other, far apart: from the camera's return until it is tracked again.
        faults = [f"{kind.format(60 + 75 * i)}" for i, kind in enumerate(KINDS)]
        self.start(f"log={self.file('faults')} " + " ".join(f"fault={f}" for f in faults), "--set",
                   "input.decimate=2")
        self.until(lambda: self.status()["frames"]["processed"] > 20)
        maplets = self.maplets()
        self.watch()
        try:
            self.until(lambda: self.read_frames() >= 75 * (len(KINDS) + 1),
                       2 * daemon.PATIENCE_S)
        finally:
            self.stop_watching()
        took = {kind: self.recovery_s(at, True) for at, what, kind in self.fault_log()
                if what == "over"}
        print("tracked again after", {kind: f"{s:.2f} s" for kind, s in took.items()}, flush=True)
        self.assertEqual(len(took), len(KINDS))
        self.assertLessEqual(max(took.values()), RETURN_S, took)
        self.assertLessEqual(maplets, self.maplets())
        self.ends_well()

    def test_memory_is_flat_over_many_returns(self):
        most = 120
        self.start("rate_hz=60 " + " ".join(f"fault=unplug@{20 * i}:50" for i in range(1, most + 1)),
                   "--set", "input.decimate=2")
        # It may step up when a camera is opened while the last one is still being closed, but stands
        # still at last; a leak never does. At some returns a buffer of OpenNI2's is there: the floor
        # counts, of a dozen returns beside the dozen before.
        resident, flat = [], False
        while not flat and len(resident) < most:
            for i in range(len(resident) + 1, len(resident) + 13):
                self.until(lambda: self.read_frames() >= 20 * i)
                resident.append(self.status()["memory"]["rss_bytes"])
            flat = len(resident) > 12 and min(resident[-12:]) - min(resident[-24:-12]) <= FLAT_BYTES
            flat = flat or SANITIZED
        print("RSS in KiB after each return:", [one >> 10 for one in resident], flush=True)
        self.assertTrue(flat, "it grows with each dozen returns")
        self.ends_well()

    def test_random_scripts(self):
        # MAPLET_FAULT_SCRIPTS=200 MAPLET_FAULT_FRAMES=900 is the campaign: 30 s of frames each, at
        # 150 a second (docs/testing.md).
        frames = int(os.environ.get("MAPLET_FAULT_FRAMES", "230"))
        first = int(os.environ.get("MAPLET_FAULT_FIRST", "0"))
        self.longest_s, self.most_grown = 0.0, 0
        for seed in range(first, first + int(os.environ.get("MAPLET_FAULT_SCRIPTS", "2"))):
            dice = random.Random(seed)
            faults = [dice.choice(KINDS).format(dice.randrange(10, frames - 30))
                      for _ in range(6 * frames // 230)]
            with self.subTest(seed=seed, faults=faults):
                self.random_script(seed, frames, faults)
        print(f"longest return {self.longest_s:.2f} s, most memory {self.most_grown / 1024:.0f} KiB",
              flush=True)

    def random_script(self, seed, frames, faults):
        for old in ("faults", "socket"):
            Path(self.file(old)).unlink(missing_ok=True)
        self.start(f"rate_hz=150 log={self.file('faults')} " +
                   " ".join(f"fault={fault}" for fault in faults), "--set", "input.decimate=2",
                   *PRIORITY)
        self.watch()
        try:
            self.until(lambda: self.read_frames() >= frames // 2)
            half, maplets = self.status(), self.maplets()
            self.until(lambda: self.read_frames() >= frames - 20)
            self.until(lambda: self.status()["tracking"]["now"])
            time.sleep(0.1)
        finally:
            self.stop_watching()
        last = self.status()
        log = self.fault_log()
        returns = [at for at, what, _ in log if what == "over"]
        # Frames flow after each return, unless the next fault stops them; all is well after the last.
        longest = max([self.recovery_s(at, False) for at in returns if not any(
            at <= then <= at + RETURN_S and what == "begins" and kind in ("stall", "unplug")
            for then, what, kind in log)] + [self.recovery_s(max(returns), True)])
        self.longest_s = max(self.longest_s, longest)
        grown = last["memory"]["rss_bytes"] - half["memory"]["rss_bytes"]
        self.most_grown = max(self.most_grown, grown)
        print(seed, f"return {longest:.2f} s, RSS {last['memory']['rss_bytes'] / 2**20:.1f} MiB, "
              f"{grown / 1024:+.0f} KiB", flush=True)
        self.assertLessEqual(longest, RETURN_S, log)
        if not SANITIZED:
            self.assertLessEqual(grown, SCRIPT_BYTES)
        self.assertLessEqual(maplets, self.maplets())
        self.ends_well()

    def read_frames(self):
        return self.status()["frames"]["read"]


if __name__ == "__main__":
    unittest.main(verbosity=2)
