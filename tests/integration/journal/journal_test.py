#!/usr/bin/env python3
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""The daemon's life with a journal: resume, disks of every kind, other agents' and other versions."""
import json
import os
import subprocess
import sys
import time
import unittest
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[2] / "support"))
import daemon  # noqa: E402

ROOM = "sim:room?seed=3&width=160&frames=400"
LOOP = "sim:loop?seed=3&width=320&frames=900"
DISK = os.environ.get("MAPLET_DISK_LIBRARY", "")


class JournalTest(daemon.DaemonTest):
    def state(self):
        return self.file("state")

    def run_service(self, *more, environment=None, source=ROOM):
        self.start("--source", source, "--state", self.state(), "--set", "journal.size_mib=8", *more,
                   environment=environment)
        self.until(lambda: os.path.exists(self.file("socket")))

    def journal(self):
        return self.status()["journal"]

    def until_flushed(self, maplets):
        self.until(lambda: self.journal()["flushed"].get("maplets", 0) >= maplets)

    def mission(self, *words):
        done = subprocess.run([str(daemon.BIN / "mapletctl"), "mission", *words], text=True,
                              capture_output=True, timeout=daemon.PATIENCE_S)
        return done.returncode, done.stdout, done.stderr

    def listed(self, folder=None):
        code, said, wrong = self.mission("list", "--json", "--state", folder or self.state())
        self.assertEqual(code, 0, wrong)
        return json.loads(said)

    def fill(self, source=ROOM):
        """A mission of a whole run, ended in order. @return what is listed of it"""
        self.run_service(source=source)
        self.until_flushed(3)
        self.assertEqual(self.stop()[0], 0)
        return self.listed()


class Resume(JournalTest):
    def test_a_killed_mission_goes_on_where_it_was_safe(self):
        self.run_service()
        self.until_flushed(3)
        before = self.status()
        safe = self.journal()["flushed"]
        self.daemon.kill()
        self.daemon.communicate()
        listed = self.listed()
        for stream, end in safe.items():
            self.assertGreaterEqual(listed["flushed"][stream], end)
        self.assertEqual(sum(listed["missing"].values()), 0)
        os.remove(self.file("socket"))
        self.run_service()
        after = self.status()
        self.assertEqual(after["epoch"], before["epoch"])
        self.until_flushed(listed["maplets"] + 2)
        _, _, said = self.stop()
        self.assertIn(f"resumed {listed['maplets']} maplet(s)", said)
        again = self.listed()
        self.assertEqual([p["first_maplet"] for p in again["parts"]], [0, listed["maplets"]])
        self.assertEqual(sum(again["missing"].values()), 0)

    def test_both_parts_stand_side_by_side_until_a_closure_joins_them(self):
        listed = self.fill()
        self.run_service()
        self.until_flushed(listed["maplets"] + 1)
        maplets = json.loads(self.ctl("maplets", "--json")[1])
        groups = {(m["map"]["agent"], m["map"]["id"]) for m in maplets}
        self.assertIn((0, 0), groups)  # the old part's gauge is its own
        self.assertEqual(sum(m["id"] < listed["maplets"] for m in maplets), listed["maplets"])

    def test_the_same_place_seen_again_is_joined(self):
        self.fill(LOOP)
        self.run_service(source=LOOP)
        self.until(lambda: len({m["map"]["id"] for m in
                                json.loads(self.ctl("maplets", "--json")[1])}) == 1
                   and self.status()["closures"] > 0)

    def test_without_a_state_directory_there_is_no_journal(self):
        self.start("--source", ROOM, environment={"STATE_DIRECTORY": ""})
        self.until(lambda: os.path.exists(self.file("socket")))
        self.assertEqual(self.journal(), {"state": "off", "flushed": {}, "directory": ""})

    def test_systemds_folder_is_the_default(self):
        self.start("--source", ROOM, "--set", "journal.size_mib=8",
                   environment={"STATE_DIRECTORY": self.state()})
        self.until(lambda: os.path.exists(self.file("socket")))
        self.assertEqual(self.journal()["state"], "on")


class Refused(JournalTest):
    def ends(self, code, word, *more):
        self.start("--source", ROOM, "--state", self.state(), *more)
        _, said = self.daemon.communicate(timeout=daemon.PATIENCE_S)
        self.assertEqual(self.daemon.returncode, code, said)
        self.assertIn(word, said)

    def bytes(self):
        return Path(self.state(), "mission.journal").read_bytes()

    def test_two_daemons_on_one_folder(self):
        self.run_service()
        first = self.daemon
        self.ends(1, "another mapletd", "--set", "control.socket=none")
        self.daemon = first
        self.assertEqual(self.journal()["state"], "on")

    def test_another_agents_mission_is_left_as_it_is(self):
        self.fill()
        before = self.bytes()
        self.ends(2, "mission of agent 0", "--agent", "5")
        self.assertEqual(self.bytes(), before)

    def test_a_newer_version_is_left_as_it_is(self):
        os.makedirs(self.state())
        corpus = Path(__file__).resolve().parents[2] / "fuzz/corpus/journal/newer_version"
        Path(self.state(), "mission.journal").write_bytes(corpus.read_bytes()[1:])
        before = self.bytes()
        self.ends(2, "newer mapletd")
        self.assertEqual(self.bytes(), before)

    def test_an_older_version_is_taken_over(self):
        os.makedirs(self.state())
        corpus = Path(__file__).resolve().parents[2] / "fuzz/corpus/journal/older_version"
        Path(self.state(), "mission.journal").write_bytes(corpus.read_bytes()[1:])
        self.assertEqual(self.listed()["version"], 1)
        self.start("--source", ROOM, "--state", self.state(), "--agent", "1")
        self.until(lambda: os.path.exists(self.file("socket")))
        self.assertEqual(self.status()["epoch"], 7)
        self.stop()
        self.assertEqual(self.listed()["version"], 2)


class Disks(JournalTest):
    def test_rubbish_is_set_aside(self):
        os.makedirs(self.state())
        Path(self.state(), "mission.journal").write_bytes(b"rubbish" * 1000)
        self.run_service()
        self.until_flushed(1)
        self.assertTrue(os.path.exists(os.path.join(self.state(), "mission.journal.damaged")))

    def test_a_folder_that_cannot_be_is_memory_alone(self):
        Path(self.state()).write_text("a file", encoding="utf-8")
        self.run_service()
        self.assertEqual(self.journal()["state"], "off")
        _, _, said = self.stop()
        self.assertIn("goes on in memory", said)

    @unittest.skipUnless(DISK, "no mocked disk under a sanitizer")
    def test_a_disk_without_room_is_memory_alone(self):
        Path(self.file("mood")).write_text("f", encoding="utf-8")
        self.run_service(environment={"LD_PRELOAD": DISK, "MAPLET_DISK": self.file("mood")})
        self.assertEqual(self.journal()["state"], "off")
        self.until(lambda: self.status()["maplets"] > 1)
        _, _, said = self.stop()
        self.assertIn("No space left", said)

    @unittest.skipUnless(DISK, "no mocked disk under a sanitizer")
    def test_a_disk_that_breaks_is_tried_again(self):
        self.run_service("--pace", "recorded",
                         environment={"LD_PRELOAD": DISK, "MAPLET_DISK": self.file("mood")})
        self.until_flushed(1)
        Path(self.file("mood")).write_text("e", encoding="utf-8")
        self.until(lambda: self.journal()["state"] == "waiting")
        os.remove(self.file("mood"))
        self.until(lambda: self.journal()["state"] == "on")
        self.assertEqual(self.journal()["held_back"], 0)
        _, _, said = self.stop()
        self.assertIn("own records wait", said)
        self.assertEqual(sum(self.listed()["missing"].values()), 0)

    @unittest.skipUnless(DISK, "no mocked disk under a sanitizer")
    def test_a_slow_disk_holds_nobody_up(self):
        Path(self.file("mood")).write_text("s", encoding="utf-8")
        self.run_service("--pace", "recorded",
                         environment={"LD_PRELOAD": DISK, "MAPLET_DISK": self.file("mood")})
        self.until_flushed(2)
        status = self.status()
        self.assertEqual(status["journal"]["state"], "on")
        self.assertEqual(status["memory"]["heap_allocations_after_ready"], 0)
        self.stop()


class Missions(JournalTest):
    def test_export_is_a_folder_as_of_a_run(self):
        listed = self.fill()
        out = self.file("out")
        code, _, wrong = self.mission("export", out, "--state", self.state())
        self.assertEqual(code, 0, wrong)
        names = {p.name for p in Path(out).iterdir()}
        self.assertGreaterEqual(names, {"trajectory.tum", "skeleton.g2o", "map.ply", "maplets",
                                        "delta_poses.jsonl", "mission.journal"})
        self.assertEqual(len(list(Path(out, "maplets").iterdir())), listed["maplets"])
        self.assertEqual(self.listed(out)["flushed"], listed["flushed"])

    def test_import_stands_beside_the_own_mission(self):
        listed = self.fill()
        other = self.file("other")
        code, _, wrong = self.mission("import", self.state(), "--state", other)
        self.assertEqual(code, 0, wrong)
        self.start("--source", ROOM, "--state", other, "--agent", "9")
        self.until(lambda: os.path.exists(self.file("socket")))
        self.until(lambda: self.status()["maplets"] > 1)
        maplets = json.loads(self.ctl("maplets", "--json")[1])
        self.assertEqual(sum(m["agent"] == 0 for m in maplets), listed["maplets"])
        _, _, said = self.stop()
        self.assertIn("1 imported mission", said)

    def test_clear_begins_a_new_mission(self):
        listed = self.fill()
        code, said, wrong = self.mission("clear", "--state", self.state())
        self.assertEqual((code, said.strip()), (0, "cleared"), wrong)
        self.assertEqual(self.mission("list", "--state", self.state())[0], 1)
        self.run_service("--pace", "recorded")
        self.assertNotEqual(self.status()["epoch"], listed["epoch"])

    def test_a_running_daemon_is_asked(self):
        self.run_service()
        self.until_flushed(2)
        code, said, wrong = self.ctl("mission", "list", "--json")
        self.assertEqual(code, 0, wrong)
        self.assertGreaterEqual(json.loads(said)["flushed"]["maplets"], 2)
        code, said, wrong = self.ctl("mission", "clear")
        self.assertEqual(code, 0, wrong)
        self.assertIn("next start", said)
        self.stop()
        os.path.exists(self.file("socket")) and os.remove(self.file("socket"))
        self.run_service()
        self.assertEqual(len(self.listed()["parts"]), 1)


if __name__ == "__main__":
    unittest.main()
