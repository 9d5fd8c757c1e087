#!/usr/bin/env python3
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""What a service must still do after long, under load, and often: docs/testing.md, label slow."""
import json
import multiprocessing
import os
import statistics
import subprocess
import sys
import time
import unittest
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "support"))
import daemon  # noqa: E402

SOAK_S = float(os.environ.get("MAPLET_SOAK_S", "300"))
SOAK_FRAMES = 200_000
CYCLES = int(os.environ.get("MAPLET_CYCLES", "100"))
LOOP = "sim:loop?seed=7&width=320"


def busy():
    while True:
        pass


class Campaign(daemon.DaemonTest):
    def finite(self, name, source, *more):
        """A run from start to end in a folder of its own. @return its report, its trajectory."""
        out = self.file(name)
        subprocess.run([str(daemon.BIN / "mapletd"), "--no-dds", "--source", source, "--out", out,
                        "--set", "control.socket=none", *more], check=True, capture_output=True)
        report = json.loads(Path(out, "report.json").read_text(encoding="utf-8"))
        return report, os.path.join(out, "trajectory.tum")

    def ate_m(self, truth, estimate):
        done = subprocess.run([str(daemon.BIN / "mapletctl"), "eval", "--truth", truth,
                               "--estimate", estimate, "--json"], check=True, capture_output=True)
        return json.loads(done.stdout)["ate_rms_m"]


class Soak(Campaign):
    def test_memory_stays_where_it_was_after_the_first_minute(self):
        self.start("--source", "sim:loop?seed=7&width=160&frames=1000000", "--pace", "fast")
        self.until(lambda: "READY=1" in self.heard)
        self.until(lambda: os.path.exists(self.file("socket")))
        begin = time.monotonic()
        time.sleep(min(60.0, SOAK_S / 3))
        early = self.status()
        now = early
        while time.monotonic() - begin < SOAK_S and now["frames"]["processed"] < SOAK_FRAMES:
            time.sleep(5.0)
            now = self.status()
        grown = now["memory"]["rss_bytes"] - early["memory"]["rss_bytes"]
        print(f"soak: {now['frames']['processed']} frames in {time.monotonic() - begin:.0f} s, "
              f"RSS {now['memory']['rss_bytes'] / 2**20:.1f} MiB, {grown / 1024:+.0f} KiB since "
              f"frame {early['frames']['processed']}")
        self.assertLessEqual(grown, 256 * 1024)
        self.assertIn(now["memory"]["heap_allocations_after_ready"], (0, None))
        self.assertGreater(now["frames"]["processed"], 2 * early["frames"]["processed"])
        self.assertEqual(self.stop()[0], 0)


class Overload(Campaign):
    FRAMES = 1500

    def test_frames_are_in_time_by_degrading(self):
        source = f"{LOOP}&frames={self.FRAMES}"
        truth = self.file("truth")
        subprocess.run([str(daemon.BIN / "mapletctl"), "simulate", source, "--out", truth,
                        "--truth-only"], check=True, capture_output=True)
        truth = os.path.join(truth, "groundtruth.txt")
        _, calm = self.finite("calm", source)
        others = [multiprocessing.Process(target=busy, daemon=True) for _ in range(2)]
        for other in others:
            other.start()
        try:
            report, loaded = self.finite(
                "loaded", source, "--pace", "recorded", "--set", "realtime.estimator_priority=20",
                "--set", "realtime.capture_priority=30", "--set", "frame.budget_us=16500")
        finally:
            for other in others:
                other.kill()
        frame = report["stages"]["frame"]
        late = frame["deadline_misses"] / frame["count"]
        calm_m, loaded_m = self.ate_m(truth, calm), self.ate_m(truth, loaded)
        print(f"overload: {frame['count']} of {self.FRAMES} frames, {100 * late:.2f} % late, p99 "
              f"{frame['p99_us'] / 1e3:.1f} ms, ATE {1e3 * loaded_m:.1f} mm, calm {1e3 * calm_m:.1f}")
        self.assertLessEqual(late, 0.01)
        self.assertLessEqual(loaded_m, 2 * calm_m)


class StartStop(Campaign):
    def test_every_start_is_ready_and_every_stop_is_quick(self):
        ready_s, stop_s = [], []
        for cycle in range(CYCLES):
            self.heard = []
            begin = time.monotonic()
            self.start("--source", f"{LOOP}&frames=100000", "--pace", "recorded")
            self.until(lambda: "READY=1" in self.heard)
            ready_s.append(time.monotonic() - begin)
            time.sleep(0.05 * (cycle % 5))
            code, took_s, said = self.stop()
            self.assertEqual(code, 0, said)
            stop_s.append(took_s)
            while self.notify_left():
                pass
        print(f"start-stop: {CYCLES} cycles, READY after {1e3 * statistics.median(ready_s):.0f} ms "
              f"(median; longest {1e3 * max(ready_s):.0f}), longest stop {1e3 * max(stop_s):.0f} ms")
        self.assertLess(max(stop_s), 1.0)
        self.assertLess(statistics.median(ready_s), 0.3)


if __name__ == "__main__":
    unittest.main(verbosity=2)
