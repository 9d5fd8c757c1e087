#!/usr/bin/env python3
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""The production daemon with a GPIO chip: libgpiod itself, the device node by umockdev, the kernel's
answers by gpio_mock; frames from the synthetic OpenNI2 camera."""
import ctypes
import json
import os
import random
import signal
import statistics
import subprocess
import sys
import time
import unittest
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path += [str(HERE.parent / "support"), str(HERE / "gpio_mock")]
import daemon  # noqa: E402
import gpio_mock  # noqa: E402

RUNTIME = os.environ["MAPLET_SYNTH_RUNTIME"]
LIBRARY = os.environ["MAPLET_GPIO_LIBRARY"]
CAMERA = ["--source", "openni2:"]
for key, value in {"width_px": 320, "height_px": 240, "fx_px": 285, "fy_px": 285, "cx_px": 159.5,
                   "cy_px": 119.5}.items():
    CAMERA += ["--set", f"camera.{key}={value}"]
NAMES = ["TRACKING", "HEARTBEAT", "HOLD", "PPS"]


class Gpio(daemon.DaemonTest):
    def start_with(self, *settings, taken=(), script="", levels=None):
        self.chip = gpio_mock.Chip(self.folder.name, NAMES, taken)
        for name, level in (levels or {}).items():
            self.chip.start_level(name, level)
        words = [word for setting in settings for word in ("--set", f"gpio.{setting}")]
        self.start(*CAMERA, *words, wrapper=self.chip.wrapper(), environment={
            "LD_LIBRARY_PATH": RUNTIME, **self.chip.environment(LIBRARY),
            "MAPLET_SYNTH": f"world=room sim.seed=3 sim.frames=100000 rate_hz=30 {script}"})

    def runs(self):
        self.until(lambda: os.path.exists(self.file("socket")))
        self.until(lambda: self.status()["tracking"]["now"])

    def gpio(self):
        return self.status()["gpio"]

    def ends_well(self):
        status = self.status()
        self.assertEqual(status["memory"]["heap_allocations_after_ready"], 0)
        code, _, said = self.stop()
        self.assertEqual(code, 0, said)
        for name in NAMES:
            self.assertFalse(self.chip.taken(name), name)
        return said

    def test_hold_pauses_and_lets_go(self):
        self.start_with("hold=HOLD", "tracking=gpiochip0:0")
        self.runs()
        self.until(lambda: self.status()["maplets"] >= 1 or
                   self.status()["frames"]["processed"] > 120)
        self.until(lambda: self.chip.level("TRACKING") == 1)
        self.chip.drive("HOLD", 1)
        self.until(lambda: self.status()["state"] == "held", 5)
        before = self.status()
        time.sleep(1.0)
        after = self.status()
        self.assertEqual(after["frames"]["processed"], before["frames"]["processed"])
        self.assertGreater(after["frames"]["read"], before["frames"]["read"])
        self.assertEqual(after["frames"]["dropped"], before["frames"]["dropped"])
        self.assertEqual(after["maplets"], before["maplets"])
        self.assertEqual(self.chip.level("TRACKING"), 0)
        self.chip.drive("HOLD", 0)
        self.until(lambda: self.status()["frames"]["processed"] >=
                   before["frames"]["processed"] + 5, 5)
        self.until(lambda: self.chip.level("TRACKING") == 1)
        self.assertGreaterEqual(self.status()["maplets"], before["maplets"])
        self.ends_well()
        self.assertEqual(self.chip.level("TRACKING"), 0)

    def test_a_bouncing_switch_counts_once_it_is_quiet(self):
        self.start_with("hold=HOLD", "hold_debounce_ms=150")
        self.runs()
        for _ in range(10):  # ends as it was
            self.chip.drive("HOLD", 1)
            time.sleep(0.01)
            self.chip.drive("HOLD", 0)
            time.sleep(0.01)
        begin = time.monotonic()
        while time.monotonic() < begin + 0.6:
            self.assertFalse(self.gpio()["hold"])
        self.chip.drive("HOLD", 1)
        self.until(lambda: self.gpio()["hold"], 5)
        self.chip.drive("HOLD", 0)
        self.until(lambda: self.status()["state"] == "running", 5)
        self.ends_well()

    def test_held_from_the_start_by_an_active_low_switch(self):
        self.start_with("hold=HOLD", "hold_active_low=true", levels={"HOLD": 0})
        self.until(lambda: os.path.exists(self.file("socket")))
        self.until(lambda: self.status()["state"] == "held")
        self.assertEqual(self.status()["frames"]["processed"], 0)
        self.chip.drive("HOLD", 1)
        self.until(lambda: self.status()["tracking"]["now"])
        self.ends_well()

    def test_heartbeat_rate(self):
        self.start_with("heartbeat=maplet-mock:HEARTBEAT", "heartbeat_hz=5", "tracking=TRACKING",
                        "tracking_active_low=true")
        self.runs()
        self.until(lambda: self.chip.level("TRACKING") == 0)
        time.sleep(4.0)
        self.assertTrue(self.gpio()["heartbeat"])
        changes = self.chip.driven("HEARTBEAT")[1:]  # the first one takes the line
        times = [at for at, _ in changes]
        gaps = [b - a for a, b in zip(times, times[1:])]
        self.assertGreater(len(gaps), 30)
        self.assertEqual([level for _, level in changes], [(i + 1) % 2 for i in range(len(changes))])
        rate = (len(gaps) / 2) / (times[-1] - times[0])
        print(f"heartbeat {rate:.3f} Hz, gaps {min(gaps):.4f} .. {max(gaps):.4f} s", flush=True)
        self.assertAlmostEqual(rate, 5.0, delta=0.1)
        self.assertAlmostEqual(statistics.median(gaps), 0.1, delta=0.01)
        self.ends_well()
        self.assertEqual(self.chip.level("TRACKING"), 1)

    def test_the_heartbeat_stops_with_the_estimator(self):
        self.start_with("heartbeat=HEARTBEAT", "heartbeat_hz=10")
        self.runs()
        pid = self.mapletd()
        self.stop_estimator()
        time.sleep(3.0)
        still = len(self.chip.driven("HEARTBEAT"))
        time.sleep(1.0)
        now = len(self.chip.driven("HEARTBEAT"))
        os.kill(pid, signal.SIGKILL)  # one that is traced gets no other
        self.assertEqual(now, still)

    def stop_estimator(self):
        """The one thread, by the debugger's call; its process then is only good for an end."""
        libc = ctypes.CDLL(None, use_errno=True)
        pid = self.mapletd()
        if libc.ptrace(0x4206, pid, None, None) != 0:  # PTRACE_SEIZE: this thread alone
            self.skipTest("ptrace is not allowed here")
        self.assertEqual(libc.ptrace(0x4207, pid, None, None), 0)  # PTRACE_INTERRUPT

    def mapletd(self):
        """The daemon's process under umockdev-run."""
        children = Path(f"/proc/{self.daemon.pid}/task/{self.daemon.pid}/children").read_text()
        for child in [self.daemon.pid, *map(int, children.split())]:
            if Path(f"/proc/{child}/comm").read_text().strip() == "mapletd":
                return child
        self.fail("no mapletd below " + str(self.daemon.pid))

    def test_pulse_jitter(self):
        self.start_with("pulse=PPS")
        self.runs()
        dice = random.Random(8)
        ppm, jitter_s, count = 40.0, 200e-6, 40
        begin = time.monotonic() - count
        for i in range(count):
            if i == 20:
                continue  # one is missing
            at = begin + i * (1 + ppm * 1e-6) + dice.uniform(-jitter_s, jitter_s)
            self.chip.drive("PPS", 1, at)
            self.chip.drive("PPS", 0, at + 0.1)
            if i == 30:  # interference
                self.chip.drive("PPS", 1, at + 0.4)
                self.chip.drive("PPS", 0, at + 0.401)
        self.until(lambda: self.gpio()["pulse"]["pulses"] >= count - 1, 5)
        pulse = self.gpio()["pulse"]
        print(pulse, flush=True)
        self.assertTrue(pulse["locked"])
        self.assertEqual((pulse["glitches"], pulse["missed"]), (1, 1))
        self.assertAlmostEqual(pulse["frequency_ppm"], ppm, delta=25)  # 115 us over 16 s
        self.assertLess(pulse["jitter_us"], 200)
        self.assertGreater(pulse["jitter_us"], 40)
        self.until(lambda: not self.gpio()["pulse"]["locked"], 10)  # nothing comes any more
        self.ends_well()

    def test_a_line_in_use_is_said_and_done_without(self):
        self.start_with("tracking=TRACKING", "heartbeat=HEARTBEAT", "hold=NOSUCH",
                        taken=("TRACKING",))
        self.runs()
        problems = self.gpio()["problems"]
        self.assertEqual(len(problems), 2)
        self.assertIn("'TRACKING': in use by 'somebody'", problems[0])
        self.assertIn("'NOSUCH': not found; there are gpiochip0 'maplet-mock' of 8 lines",
                      problems[1])
        self.assertTrue(self.gpio()["heartbeat"])
        code, _, said = self.stop()
        self.assertEqual(code, 0, said)
        self.assertEqual(said.count("in use by"), 1)

    def test_a_required_line_in_use_is_an_end(self):
        self.start_with("tracking=TRACKING", "required=true", taken=("TRACKING",))
        _, said = self.daemon.communicate(timeout=daemon.PATIENCE_S)
        self.assertEqual(self.daemon.returncode, 1)
        self.assertIn("in use by 'somebody'", said)

    def test_no_chip_at_all(self):
        self.start("--source", "sim:room?frames=100000", "--pace", "recorded", "--set",
                   "gpio.tracking=TRACKING", "--set", "gpio.required=true")
        _, said = self.daemon.communicate(timeout=daemon.PATIENCE_S)
        self.assertEqual(self.daemon.returncode, 1)
        self.assertTrue("no GPIO chip" in said or "not found" in said, said)

    def test_a_chip_that_is_pulled_out(self):
        self.start_with("hold=HOLD", "heartbeat=HEARTBEAT", "pulse=PPS")
        self.runs()
        self.chip.pull_out()
        self.until(lambda: len(self.gpio()["problems"]) == 3, 5)
        before = self.status()["frames"]["processed"]
        self.until(lambda: self.status()["frames"]["processed"] > before + 5, 5)
        code, _, said = self.stop()
        self.assertEqual(code, 0, said)
        self.assertIn("the chip is gone", said)

    def test_check_lists_chips_and_lines(self):
        chip = gpio_mock.Chip(self.folder.name, NAMES, ("PPS",))
        done = subprocess.run(
            [*chip.wrapper(), str(daemon.BIN / "mapletctl"), "check", "--json", "--source",
             "sim:room", "--set", "gpio.hold=HOLD", "--set", "gpio.pulse=PPS"],
            env=dict(os.environ, **chip.environment(LIBRARY)), capture_output=True, text=True,
            timeout=daemon.PATIENCE_S)
        lines = [line for line in json.loads(done.stdout) if line["name"] == "gpio"]
        self.assertEqual([line["result"] for line in lines], ["OK", "OK", "WARN"], lines)
        self.assertIn("gpiochip0", lines[0]["detail"])
        self.assertIn("in use by 'somebody'", lines[2]["detail"])


if __name__ == "__main__":
    unittest.main(verbosity=2)
