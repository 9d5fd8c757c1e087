#!/usr/bin/env python3
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""The local domain between real processes: what a publisher says arrives, line for line."""
import json
import os
import signal
import subprocess
import sys
import threading
import time
import unittest
from pathlib import Path

BIN = Path(os.environ["MAPLET_BIN_DIR"])
MAPLETCTL = str(BIN / "mapletctl")
PUBLISH = str(BIN.parent / "tests" / "dds_publish")
PATIENCE_S = 60.0  # for a loaded machine; nothing here takes more than a few seconds


class RoundTrip(unittest.TestCase):
    next_domain = 20 + os.getpid() % 200  # builds of several trees may test at once

    def setUp(self):
        RoundTrip.next_domain = (RoundTrip.next_domain + 1) % 231
        self.domain = str(RoundTrip.next_domain)
        self.children = []

    def tearDown(self):
        for child in self.children:
            if child.poll() is None:
                child.kill()
            child.communicate()

    def start(self, *command):
        child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.children.append(child)
        return child

    def watch(self, *options):
        return self.start(MAPLETCTL, "watch", "--domain", self.domain, "--timeout-s",
                          str(PATIENCE_S), *options)

    def wait_for_watcher(self):
        """Until the first watcher's port is bound: it is in the domain then."""
        port = 7400 + 250 * int(self.domain) + 10 + 2 * 32
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            rows = Path("/proc/net/udp").read_text().splitlines()[1:]
            if any(row.split()[1].endswith(f":{port:04X}") for row in rows):
                return
            time.sleep(0.02)
        self.fail("the watcher did not come up")

    def finish(self, child, code=0):
        out, err = child.communicate(timeout=PATIENCE_S)
        self.assertEqual(child.returncode, code, err)
        return out.splitlines(), err.splitlines()

    def test_every_line_arrives_identical(self):
        watcher = self.watch("--json", "--kind", "delta-pose", "--count", "200")
        self.wait_for_watcher()
        sent, _ = self.finish(self.start(PUBLISH, self.domain, "1", "200"))
        got, _ = self.finish(watcher)
        self.assertEqual(len(sent), 200)
        self.assertEqual(got, sent)

    def test_late_subscriber_gets_what_was_said(self):
        publisher = self.start(PUBLISH, self.domain, "1", "200", "4000")
        sent = [publisher.stdout.readline()]  # it has begun
        # Its lines are more than a pipe holds: unread, they would stop it half-way.
        drain = threading.Thread(target=lambda: sent.extend(publisher.stdout))
        drain.start()
        time.sleep(0.3)
        got, _ = self.finish(self.watch("--json", "--kind", "delta-pose", "--count", "200"))
        drain.join(PATIENCE_S)
        self.assertEqual(publisher.wait(PATIENCE_S), 0)
        self.assertEqual(got, [line.rstrip("\n") for line in sent])

    def test_two_agents_and_two_watchers_coexist(self):
        watchers = [self.watch("--json", "--kind", "delta-pose", "--count", "120")]
        self.wait_for_watcher()
        watchers.append(self.watch("--json", "--kind", "delta-pose", "--count", "120"))
        publishers = [self.start(PUBLISH, self.domain, agent, "60", "2000") for agent in "12"]
        sent = [self.finish(publisher)[0] for publisher in publishers]
        for watcher in watchers:
            got, _ = self.finish(watcher)
            for agent in (1, 2):
                self.assertEqual([line for line in got if json.loads(line)["agent"] == agent],
                                 sent[agent - 1])

    def test_same_agent_twice_takes_another_index(self):
        publishers = [self.start(PUBLISH, self.domain, "3", "1", "500") for _ in range(2)]
        for publisher in publishers:
            self.finish(publisher)

    def test_kinds_are_told_apart(self):
        watcher = self.watch("--json", "--kind", "maplet,status", "--count", "4")
        self.wait_for_watcher()
        self.finish(self.start(PUBLISH, self.domain, "1", "30"))
        got = [json.loads(line) for line in self.finish(watcher)[0]]
        maplets = [line for line in got if line["type"] == "maplet"]
        self.assertEqual([(m["agent"], m["epoch"], m["id"], m["bytes"]) for m in maplets],
                         [(1, 7, 0, 5000), (1, 7, 10, 5000), (1, 7, 20, 5000)])
        self.assertEqual([line["state"] for line in got if line["type"] == "status"], ["starting"])

    def test_people_get_a_line_per_message(self):
        watcher = self.watch("--count", "3", "--kind", "delta-pose")
        self.wait_for_watcher()
        self.finish(self.start(PUBLISH, self.domain, "1", "3"))
        got, err = self.finish(watcher)
        self.assertEqual(len(got), 3)
        self.assertIn("1:0000 -> 1:0001", got[0])
        self.assertEqual(err, [])  # "waiting for..." is for terminals

    def test_signals_end_it_cleanly(self):
        for number in (signal.SIGINT, signal.SIGTERM):
            watcher = self.watch()
            self.wait_for_watcher()
            start = time.monotonic()
            watcher.send_signal(number)
            _, err = self.finish(watcher)
            self.assertEqual(err, [])
            self.assertLess(time.monotonic() - start, 10.0)

    def test_closed_pipe_ends_it(self):
        watcher = self.watch("--json")
        self.wait_for_watcher()
        watcher.stdout.close()
        self.start(PUBLISH, self.domain, "1", "5")
        self.assertEqual(watcher.wait(timeout=PATIENCE_S), 0)

    def test_missing_interface_is_one_line(self):
        for child in (self.watch("--interface", "no0such"),
                      self.start(PUBLISH, self.domain, "1", "1", "0", "no0such")):
            _, err = self.finish(child, code=1)
            self.assertEqual(len(err), 1, err)
            self.assertIn("no0such", err[0])
            self.assertIn("ip link", err[0])

    def test_too_few_messages_is_an_error(self):
        child = self.start(MAPLETCTL, "watch", "--domain", self.domain, "--count", "1",
                           "--timeout-s", "0.3")
        _, err = self.finish(child, code=1)
        self.assertEqual(len(err), 1, err)
        self.assertIn("0 of 1", err[0])

    def test_usage_errors_exit_2(self):
        for wrong in (["--domain", "999"], ["--kind", "nonsense"], ["--timeout-s", "-1"]):
            self.finish(self.start(MAPLETCTL, "watch", *wrong), code=2)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], "-v"])
