#!/usr/bin/env python3
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""What may go wrong around a service: too little memory, no rights, a clock that leaps, clients."""
import json
import os
import resource
import socket
import stat
import struct
import subprocess
import sys
import threading
import time
import unittest
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[2] / "support"))
import daemon  # noqa: E402

WORLD = "sim:loop?seed=7&width=160&rate_hz=10&frames=100000"
NOBODY = 65534
SANITIZED = "MAPLET_SANITIZED" in os.environ  # reserves memory of its own


def as_nobody():
    resource.setrlimit(resource.RLIMIT_MEMLOCK, (0, 0))
    os.setgroups([])
    os.setgid(NOBODY)
    os.setuid(NOBODY)


class MemoryGroup:
    """A control group of ours with a limit, of either version."""
    ROOTS = {"/sys/fs/cgroup/memory": ("memory.limit_in_bytes", "cgroup.procs"),
             "/sys/fs/cgroup": ("memory.max", "cgroup.procs")}

    def __init__(self, limit_bytes):
        for root, (limit, procs) in self.ROOTS.items():
            self.folder = Path(root, f"mapletd-test-{os.getpid()}")
            try:
                self.folder.mkdir()
                (self.folder / limit).write_text(str(limit_bytes), encoding="utf-8")
                self.procs = self.folder / procs
                return
            except OSError:
                self.remove()
        raise unittest.SkipTest("SKIPPED: no control group of memory can be made here")

    def enter(self):
        self.procs.write_text(str(os.getpid()), encoding="utf-8")

    def remove(self):
        if self.folder.is_dir():
            self.folder.rmdir()


class Trouble(daemon.DaemonTest):
    def start(self, *more, source=WORLD, **how):
        super().start("--source", source, "--pace", "recorded", *more, **how)

    def serves(self):
        self.until(lambda: os.path.exists(self.file("socket")))
        self.until(lambda: self.status()["frames"]["processed"] > 5)

    def for_everybody(self):
        if os.getuid() != 0:
            self.skipTest("SKIPPED: not root")
        os.chmod(self.folder.name, 0o777)
        os.chmod(self.file("notify"), 0o777)

    @unittest.skipIf(SANITIZED, "the sanitizer itself does not fit")
    def test_a_control_group_that_is_too_small(self):
        for limit_mib in (20, 48):  # less than the arena; less than all of it
            group = MemoryGroup(limit_mib << 20)
            try:
                self.start("--out", self.file("out"), before=group.enter)
                _, said = self.daemon.communicate(timeout=daemon.PATIENCE_S)
            finally:
                group.remove()
            self.assertEqual(self.daemon.returncode, 2, said)
            self.assertIn(f"the control group allows {limit_mib} MiB, this configuration needs",
                          said)
            self.assertIn("or raise MemoryMax", said)
            self.assertRegex(said, r"(?m)^patches/\w.* +\d+ +\d+$")  # the ledger
            self.assertRegex(said, r"(?m)^total +\d+$")
            self.assertFalse(os.path.exists(self.file("out")))

    def test_memory_that_may_not_be_locked(self):
        self.for_everybody()
        self.start(before=as_nobody)
        self.serves()
        self.assertFalse(self.status()["memory"]["locked"])
        code, _, said = self.stop()
        self.assertEqual(code, 0, said)
        self.assertEqual(said.count("memory is not locked: grant LimitMEMLOCK"), 1, said)
        self.start("--set", "realtime.required=true", before=as_nobody)
        _, said = self.daemon.communicate(timeout=daemon.PATIENCE_S)
        self.assertEqual(self.daemon.returncode, 1)
        self.assertIn("LimitMEMLOCK", said)
        self.assertIn("realtime.required", said)

    def test_an_error_is_said_before_what_could_be_better(self):
        self.for_everybody()
        self.start("--out", self.file("out"), source="tum:/nowhere", before=as_nobody)
        _, said = self.daemon.communicate(timeout=daemon.PATIENCE_S)
        self.assertEqual(self.daemon.returncode, 1)
        self.assertIn("/nowhere", said.split("\n")[0])

    @unittest.skipIf(SANITIZED, "its runtime wants to be loaded first")
    def test_a_clock_that_is_not_set_and_then_leaps(self):
        clock = self.file("clock")

        def set_clock(year):
            with open(clock, "r+b" if os.path.exists(clock) else "wb") as file:
                file.write(struct.pack("q", int((year - 2026) * 31.557e6)))
        set_clock(1970.5)
        self.start("--state", self.file("state"), watchdog_s=0.4, environment={
            "LD_PRELOAD": os.environ["MAPLET_CLOCK_LIBRARY"], "MAPLET_CLOCK": clock})
        self.serves()
        for year in (2031, 1999, 2026):
            set_clock(year)
            before, fed = self.status(), self.count("WATCHDOG=1")
            self.until(lambda: self.status()["frames"]["processed"] >=
                       before["frames"]["processed"] + 10, 10)
            self.until(lambda: self.count("WATCHDOG=1") > fed + 2, 10)
            after = self.status()
            self.until(lambda: self.status()["tracking"]["now"], 10)
            self.assertLess(after["uptime_s"] - before["uptime_s"], 30)
            self.assertLess(after["stages"]["frame"]["max_us"], 10e6)
        self.until(lambda: self.status()["journal"]["flushed"]["maplets"] > 0)
        code, took_s, said = self.stop()
        self.assertEqual(code, 0, said)
        self.assertLess(took_s, 5)

    def test_fifty_clients_at_once(self):
        self.start()
        self.serves()
        before, answers = self.status(), []

        def client():
            answers.append(self.ask({"command": "status"}))
        clients = [threading.Thread(target=client) for _ in range(50)]
        begin = time.monotonic()
        for one in clients:
            one.start()
        for one in clients:
            one.join()
        print(f"50 clients were answered in {time.monotonic() - begin:.3f} s", flush=True)
        self.assertEqual(len(answers), 50)
        self.assertTrue(all(answer["agent"] == 0 for answer in answers))
        self.until(lambda: self.status()["frames"]["processed"] >
                   before["frames"]["processed"] + 5)
        self.assertIn(self.status()["memory"]["heap_allocations_after_ready"], (0, None))
        self.assertEqual(self.stop()[0], 0)

    def test_more_clients_than_there_is_room_for_and_none_reads_or_writes(self):
        self.start()
        self.serves()
        for i in range(70):  # kMaxClients is 64
            link = socket.socket(socket.AF_UNIX)
            self.addCleanup(link.close)
            link.connect(self.file("socket"))  # waits while the backlog is full
            if i % 2 == 0:
                link.sendall(b'{"command":"status"}\n')  # and never reads
        before = self.status()  # they are let go after five seconds
        self.until(lambda: self.status()["frames"]["processed"] >
                   before["frames"]["processed"] + 5)
        self.assertEqual(self.stop()[0], 0)

    def test_the_socket_is_for_the_group(self):
        self.for_everybody()
        self.start()
        self.serves()
        self.assertEqual(stat.S_IMODE(os.stat(self.file("socket")).st_mode), 0o660)
        done = subprocess.run(
            [str(daemon.BIN / "mapletctl"), "status", "--socket", self.file("socket")],
            preexec_fn=as_nobody, capture_output=True, text=True, timeout=daemon.PATIENCE_S)
        self.assertEqual(done.returncode, 1)
        self.assertIn(self.file("socket"), done.stderr)

    def check(self, *more):
        done = subprocess.run([str(daemon.BIN / "mapletctl"), "check", "--json", *more],
                              capture_output=True, text=True, timeout=daemon.PATIENCE_S)
        lines = json.loads(done.stdout)
        self.assertEqual(done.returncode, any(line["result"] == "FAIL" for line in lines))
        for line in lines:
            self.assertIn(line["result"], ("OK", "WARN", "FAIL"))
            self.assertTrue(line["result"] == "OK" or line["remedy"] or "no depth" in line["detail"])
        return {line["name"]: line for line in lines}

    def test_check_names_what_is_wrong_and_the_remedy(self):
        fine = self.check("--source", "sim:room")
        self.assertEqual(fine["camera"]["result"], "OK")
        self.assertEqual(fine["configuration"]["result"], "OK")
        for name in ("gpio", "libcamera", "clock", "network", "peers", "memory", "memory lock",
                     "real time"):
            self.assertIn(name, fine)
        self.assertEqual(self.check("--source", "tum:/nowhere")["camera"]["result"], "FAIL")
        self.assertEqual(self.check("--source", "openni2:none")["camera"]["result"], "FAIL")
        for key, name, result in (("dds.interface=nosuch0", "network", "WARN"),
                                  ("dds.peers=nonsense", "configuration", "FAIL"),
                                  ("dds.peers=127.0.0.1", "peers", "OK"),
                                  ("dds.peers=255.255.255.255", "peers", "WARN"),
                                  ("gpio.hold=NOSUCH", "gpio", "WARN"),
                                  ("gray_camera.source=libcamera:none", "libcamera", "WARN")):
            more = ["--set", "gray_camera.fx_px=500", "--set", "gray_camera.fy_px=500"]
            lines = self.check("--source", "sim:room", "--set", key, *more)
            self.assertEqual(lines[name]["result"], result, (key, lines[name]))
        self.config("[frame]\nbudget_us = -1\n")
        wrong = self.check("--config", self.file("mapletd.toml"))["configuration"]
        self.assertEqual(wrong["result"], "FAIL")
        self.assertIn("frame.budget_us", wrong["detail"])
        self.assertIn("mapletd.toml:2", wrong["detail"])


if __name__ == "__main__":
    unittest.main(verbosity=2)
