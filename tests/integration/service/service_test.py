#!/usr/bin/env python3
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""What mapletd tells a supervisor, and how it ends: a notify socket stands in for systemd's."""
import json
import os
import re
import resource
import signal
import socket
import sys
import time
import unittest
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[2] / "support"))
import daemon  # noqa: E402

PATIENCE_S = daemon.PATIENCE_S
WORLD = "sim:loop?seed=7&width=160&rate_hz=10&frames=100000"


class Service(daemon.DaemonTest):
    def start(self, *more, source=WORLD, **how):
        super().start("--source", source, "--pace", "recorded", *more, **how)

    def test_says_ready_feeds_the_watchdog_and_stops(self):
        self.start(watchdog_s=0.4)
        self.until(lambda: "READY=1" in self.heard)
        self.until(lambda: self.count("WATCHDOG=1") >= 5)
        self.until(lambda: any(line.startswith("STATUS=tracking") for line in self.heard))
        code, took_s, _ = self.stop()
        self.assertEqual(code, 0)
        self.assertLess(took_s, 5.0)  # 1 s is measured where the machine is quiet (docs/service.md)
        while self.notify_left():
            self.listen()
        self.assertIn("STOPPING=1", self.heard)

    def test_a_missing_camera_does_not_starve_the_watchdog(self):
        self.start(source="openni2:no-such-device", watchdog_s=0.4)
        self.until(lambda: self.count("WATCHDOG=1") >= 8)
        self.until(lambda: "STATUS=waiting for a camera" in self.heard)
        self.assertIn("READY=1", self.heard)
        self.assertEqual(self.stop()[0], 0)

    def test_a_thread_that_stands_still_does(self):
        self.start(watchdog_s=0.4)
        self.until(lambda: self.count("WATCHDOG=1") >= 2)
        self.daemon.send_signal(signal.SIGSTOP)
        while self.notify_left():
            self.listen()
        fed = self.count("WATCHDOG=1")
        time.sleep(1.0)
        self.listen()
        self.assertEqual(self.count("WATCHDOG=1"), fed)
        self.daemon.send_signal(signal.SIGCONT)
        self.until(lambda: self.count("WATCHDOG=1") > fed)

    def test_reload_says_what_changed_and_what_waits(self):
        self.config("[frame]\nbudget_us = 20000\n")
        self.start()
        self.until(lambda: "READY=1" in self.heard)
        self.config("[frame]\nbudget_us = 15000\n[limits]\nown_maplets = 100\n")
        self.daemon.send_signal(signal.SIGHUP)
        self.until(lambda: self.count("READY=1") >= 2)
        self.assertTrue(any(line.startswith("RELOADING=1") for line in self.heard))
        self.config("[frame]\nbudget_us = -1\n")
        self.daemon.send_signal(signal.SIGHUP)
        self.until(lambda: self.count("READY=1") >= 3)
        code, _, said = self.stop()
        self.assertEqual(code, 0, said)
        self.assertIn("frame.budget_us 20000 -> 15000", said)
        self.assertIn("after a restart: limits.own_maplets 512 -> 100", said)
        self.assertIn("the configuration stays as it was", said)

    def test_set_changes_what_may_and_names_it(self):
        self.start()
        self.until(lambda: os.path.exists(self.file("socket")))
        code, said, _ = self.ctl("set", "frame.budget_us", "15000", "--json")
        self.assertEqual((code, json.loads(said)[0]["is"]), (0, "15000"))
        self.assertEqual(json.loads(self.ctl("set", "frame.budget_us", "15000", "--json")[1]), [])
        code, _, said = self.ctl("set", "limits.own_maplets", "9")
        self.assertEqual(code, 1)
        self.assertIn("decided at start", said)
        self.assertIn("frame.budget_us", said)
        self.assertEqual(self.ctl("set", "frame.budget_us", "1")[0], 1)
        self.assertEqual(self.ctl("set", "no.such_key", "1")[0], 1)

    def test_status_for_people_and_machines(self):
        self.start()
        self.until(lambda: os.path.exists(self.file("socket")))
        self.until(lambda: json.loads(self.ctl("status", "--json")[1])["frames"]["processed"] > 20)
        status = json.loads(self.ctl("status", "--json")[1])
        memory = status["memory"]
        # Under a sanitizer nobody counts.
        self.assertIn(memory["heap_allocations_after_ready"], (0, None))
        self.assertGreater(memory["arena_bytes"], 0)
        self.assertLessEqual(sum(memory["pools"].values()), memory["arena_bytes"])
        for fill in memory["fill"].values():
            self.assertLessEqual(fill["used"], fill["peak"])
            self.assertLessEqual(fill["peak"], fill["capacity"])
        frame = status["stages"]["frame"]["histogram"]
        self.assertGreater(sum(frame["counts"]), 20)
        self.assertEqual(len(frame["counts"]), len(frame["upper_us"]))
        text = self.ctl("status", "--prometheus")[1]
        self.assertRegex(text, r'(?m)^mapletd_stage_seconds_bucket\{stage="frame",le="0.001"\} \d')
        bucket, count = (int(re.search(r"(?m)^mapletd_stage_seconds" + name + r" (\d+)$", text)[1])
                         for name in (r'_bucket\{stage="frame",le="\+Inf"\}',
                                      r'_count\{stage="frame"\}'))
        self.assertEqual(bucket, count)
        self.assertRegex(text, r"(?m)^mapletd_frames_total\{kind=\"processed\"\} \d+")
        self.assertRegex(text, r"(?m)^# TYPE mapletd_rss_bytes|mapletd_memory_rss_bytes \d")
        code, view, _ = self.ctl("top", "--count", "2", "--every-s", "0.2")
        self.assertEqual(code, 0)
        self.assertIn("frames/s", view)
        self.until(lambda: json.loads(self.ctl("maplets", "--json")[1]) != [])

    @unittest.skipUnless(daemon.may_mount(), "no private mounts here")
    def test_the_journal_gets_fields(self):
        os.mkdir(self.file("journal"))
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as journal:
            journal.bind(self.file("journal/socket"))
            journal.settimeout(PATIENCE_S)
            self.start("--agent", "3", source="openni2:no-such-device", wrapper=(
                "unshare", "-Urm", "sh", "-c",
                "mount -t tmpfs none /run && mkdir -p /run/systemd/journal && "
                f"mount --bind {self.file('journal')} /run/systemd/journal && "
                'export JOURNAL_STREAM=$(stat -L -c %d:%i /proc/self/fd/2) && exec "$@"', "sh"))
            fields = {}
            while "waiting for a camera" not in fields.get("MESSAGE", ""):
                fields = dict(line.split("=", 1) for line in
                              journal.recv(65536).decode().splitlines() if "=" in line)
        self.assertEqual((fields["PRIORITY"], fields["SYSLOG_IDENTIFIER"]), ("4", "mapletd"))
        self.assertEqual(fields["MAPLETD_AGENT"], "3")
        self.assertRegex(fields["MAPLETD_VERSION"], r"^\d+\.\d+")
        self.assertNotIn("CODE_FILE", fields)
        self.assertEqual(self.stop()[::2], (0, ""))  # and nothing beside it

    def test_a_journal_of_others_is_not_ours(self):
        # What a service or a desktop starts inherits the variable.
        self.start(source="openni2:no-such-device", environment={"JOURNAL_STREAM": "8:12345"})
        self.until(lambda: "READY=1" in self.heard)
        self.assertIn("waiting for a camera", self.stop()[2])

    def test_real_time_that_is_refused(self):
        def no_rights():
            resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
            os.setgroups([])
            os.setgid(65534)
            os.setuid(65534)
        if os.getuid() != 0:
            self.skipTest("SKIPPED: not root")
        os.chmod(self.folder.name, 0o777)
        os.chmod(self.file("notify"), 0o777)
        self.start("--set", "realtime.estimator_priority=20", before=no_rights)
        self.until(lambda: "READY=1" in self.heard)  # degraded
        code, _, said = self.stop()
        self.assertEqual(code, 0)
        self.assertIn("grant LimitRTPRIO=20", said)
        self.start("--set", "realtime.estimator_priority=20", "--set", "realtime.required=true",
                   before=no_rights)
        _, said = self.daemon.communicate(timeout=PATIENCE_S)
        self.assertEqual(self.daemon.returncode, 1)
        self.assertIn("realtime.required", said)


if __name__ == "__main__":
    unittest.main(verbosity=2)
