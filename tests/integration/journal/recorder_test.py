#!/usr/bin/env python3
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""What the flight recorder holds replays bit for bit, decisions that depended on time included; what
differs is named. MAPLET_FLIGHTS random missions."""
import json
import os
import random
import signal
import subprocess
import sys
import time
import unittest
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[2] / "support"))
import daemon  # noqa: E402
from spoil import spoil  # noqa: E402

FLIGHTS = int(os.environ.get("MAPLET_FLIGHTS", "3"))
SEED = int(os.environ.get("MAPLET_SEED", "1"))
DISK = os.environ.get("MAPLET_DISK_LIBRARY", "")
SYNTH = os.environ.get("MAPLET_SYNTH_RUNTIME", "")
SLOW = 10 if "MAPLET_SANITIZED" in os.environ else 1


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

    def test_missions_with_faults_under_pressure_replay_bit_for_bit(self):
        dice = random.Random(SEED)
        degraded = 0
        for flight in range(FLIGHTS):
            world = dice.choice(["room", "loop", "corridor"])
            uri = (f"sim:{world}?seed={dice.randrange(1000)}&width=320"
                   f"&frames={dice.randrange(100, 200)}")
            folder = self.file(f"recording{flight}")
            subprocess.run([str(daemon.BIN / "mapletctl"), "simulate", uri, "--out", folder],
                           check=True, capture_output=True, timeout=60 * SLOW)
            faults = spoil(folder, dice)
            budget = dice.choice([1500, 2500, 4000]) * SLOW
            report = self.fly("tum:" + folder, "--pace", "recorded", "--set",
                              f"frame.budget_us={budget}")
            self.assertGreater(report["frames"]["unreadable"], 0, "no fault came through")
            pressed = report["frames"]["processed"] < report["frames"]["read"] or \
                report["stages"]["frame"]["deadline_misses"] > 0
            degraded += pressed
            again = self.replay("b")
            found = self.diff("a", "b")
            self.assertEqual(found, {"equal": True, "first": None}, uri)
            self.assertEqual(again["maplets"], report["maplets"])
            print(f"{uri}: {faults} faults, {budget} us, {report['frames']['processed']} of "
                  f"{report['frames']['read']} frames, late "
                  f"{report['stages']['frame']['deadline_misses']}, "
                  f"{report['maplets']['count']} maplets: equal", file=sys.stderr)
        self.assertGreater(degraded, 0, "nothing was under pressure")

    @unittest.skipUnless(SYNTH, "no synthetic camera")
    def test_a_camera_with_faults_replays_bit_for_bit(self):
        dice = random.Random(SEED)
        for _ in range(max(1, FLIGHTS // 3)):
            kinds = ["stall", "late", "duplicate", "burst", "black", "corrupt", "backwards"]
            faults = " ".join(f"fault={kind}@{dice.randrange(20, 150)}:{dice.randrange(1, 12)}"
                              for kind in dice.sample(kinds, 4))
            script = f"world=room sim.seed={dice.randrange(100)} sim.frames=100000 rate_hz=30 {faults}"
            small = {"width_px": 320, "height_px": 240, "fx_px": 285, "fy_px": 285, "cx_px": 159.5,
                     "cy_px": 119.5}
            sets = [word for key, value in small.items()
                    for word in ("--set", f"camera.{key}={value}")]
            self.start("--source", "openni2:", "--out", self.file("a"), "--set",
                       "recorder.file=" + self.file("flight"), "--set",
                       f"frame.budget_us={2500 * SLOW}", *sets,
                       environment={"LD_LIBRARY_PATH": SYNTH, "MAPLET_SYNTH": script})
            self.until(lambda: os.path.exists(self.file("socket"))
                       and self.status()["frames"]["read"] > 170)
            self.daemon.send_signal(signal.SIGTERM)
            _, said = self.daemon.communicate(timeout=daemon.PATIENCE_S)
            self.assertIn("stopped by a signal", said)
            self.replay("b")
            self.assertEqual(self.diff("a", "b"), {"equal": True, "first": None}, script)

    @unittest.skipUnless(SYNTH and DISK, "no synthetic camera, or no mocked disk")
    def test_what_a_camera_brings_while_the_run_ends_is_no_part_of_it(self):
        """The end waits for a disk that stalls; the camera goes on."""
        self.start("--source", "openni2:", "--out", self.file("a"), "--state", self.file("state"),
                   "--set", "recorder.file=" + self.file("flight"), "--set", "journal.size_mib=8",
                   "--set", "input.decimate=2", environment={
                       "LD_LIBRARY_PATH": SYNTH, "MAPLET_SYNTH": "world=room rate_hz=30",
                       "LD_PRELOAD": DISK, "MAPLET_DISK": self.file("mood")})
        self.until(lambda: os.path.exists(self.file("socket"))
                   and self.status()["frames"]["read"] > 40)
        Path(self.file("mood")).write_text("s", encoding="utf-8")
        self.assertEqual(self.stop()[0], 0)
        self.replay("b")
        self.assertEqual(self.diff("a", "b"), {"equal": True, "first": None})

    def test_a_mission_that_was_resumed_replays_too(self):
        state = ("--state", self.file("state"), "--set", "journal.size_mib=8")
        self.run_to("first", "--source", "sim:room?seed=3&width=160&frames=300", *state)
        self.fly("sim:room?seed=3&width=160&frames=300", *state)
        self.replay("b")
        self.assertEqual(self.diff("a", "b"), {"equal": True, "first": None})
        self.run_to("alone", "--source", "sim:room?seed=3&width=160&frames=300")
        self.assertFalse(self.diff("a", "alone")["equal"], "the mission before made no difference")

    def test_a_fast_run_replays_too(self):
        self.fly("sim:room?seed=3&width=160&frames=150")
        self.replay("b")
        self.assertTrue(self.diff("a", "b")["equal"])

    def test_the_first_frame_and_stage_that_differ_are_named(self):
        self.fly("sim:room?seed=3&width=160&frames=300")
        # One byte of the configuration that ran is another one.
        for change, stage, from_frame in (("patches.min_valid_fraction=0.6", "patches", 0),
                                          ("odometry.noise_scale=1.6", "odometry", 1),
                                          ("maplet.max_yaw_rad=1.1", "maplet", 50)):
            self.replay("b", "--set", change)
            found = self.diff("a", "b")
            self.assertFalse(found["equal"], change)
            self.assertEqual(found["first"]["stage"], stage, change)
            self.assertGreaterEqual(found["first"]["frame"], from_frame, change)
            self.assertLess(found["first"]["frame"], 300)
        self.replay("b", "--set", "patches.min_valid_fraction=0.5")  # what ran
        self.assertTrue(self.diff("a", "b")["equal"])

    def test_a_service_is_saved_while_it_runs(self):
        self.start("--source", "sim:room?seed=3&width=160&frames=100000", "--set",
                   "recorder.file=" + self.file("ring"))
        self.until(lambda: os.path.exists(self.file("socket")) and self.status()["maplets"] > 2)
        recorder = self.status()["recorder"]
        self.assertEqual((recorder["state"], recorder["file"]), ("on", self.file("ring")))
        self.assertGreater(recorder["bytes"], 0)
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

    def refused(self, source, code, word, *more):
        done = subprocess.run([str(daemon.BIN / "mapletd"), "--no-dds", "--out", self.file("x"),
                               "--source", source, *more], capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, code, done.stderr)
        self.assertIn(word, done.stderr)
        self.assertEqual(done.stderr.count("\n"), 1)
        self.assertFalse(os.path.exists(self.file("x")))

    def test_what_is_no_record_is_refused(self):
        flight = "record:" + self.file("flight")
        self.refused(flight, 1, "No such file")
        self.refused(flight, 1, "No such file", "--config", "/dev/null")
        self.refused("record:", 2, "record:FILE")
        self.refused("record:" + self.folder.name, 1, "no flight recorder's file")
        Path(self.file("flight")).write_bytes(b"nothing" * 100)
        self.refused(flight, 1, "no flight recorder's file")
        self.refused(flight + "?first=3", 2, "takes no parameters")

    def test_what_has_no_effect_on_a_replay_is_said(self):
        self.fly("sim:room?seed=3&width=160&frames=60")
        for words, said in ((["--agent", "5"], "--agent 5"), (["--pace", "recorded"], "--pace"),
                            (["--state", self.file("state")], "--state"),
                            (["--set", "recorder.file=" + self.file("again")], "recorder.file"),
                            (["--config", "/dev/null"], "/dev/null"), ([], "")):
            done = subprocess.run(
                [str(daemon.BIN / "mapletd"), "--no-dds", "--out", self.file("b"), "--source",
                 "record:" + self.file("flight"), *words], capture_output=True, text=True, timeout=60)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual("a replay" in done.stderr or "replaces what ran" in done.stderr,
                             bool(words), done.stderr)
            self.assertIn(said, done.stderr)
            self.assertTrue(self.diff("a", "b")["equal"] or words[0] == "--config")
        self.assertFalse(os.path.exists(self.file("again")))
        self.assertFalse(os.path.exists(self.file("state")))

    @unittest.skipUnless(daemon.may_mount(), "no private mounts here")
    def test_a_services_own_tmp_is_named(self):
        own = self.file("systemd-private-0f-mapletd.service/tmp")
        os.makedirs(own)
        self.start("--source", "sim:room?seed=3&width=160&frames=100000", "--set",
                   "recorder.file=/var/tmp/ring", wrapper=(
                       "unshare", "-Urm", "sh", "-c", f'mount --bind {own} /var/tmp && exec "$@"', "sh"))
        self.until(lambda: os.path.exists(self.file("socket")))
        code, _, wrong = self.ctl("recorder", "save", "--out", "/var/tmp/flight")
        self.assertEqual(code, 1)
        self.assertIn("PrivateTmp", wrong)
        code, _, wrong = self.ctl("recorder", "save", "--out", self.file("flight"))
        self.assertEqual(code, 0, wrong)
        _, _, said = self.stop()
        self.assertIn("PrivateTmp", said)


if __name__ == "__main__":
    unittest.main()
