#!/usr/bin/env python3
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""Missions in and out of a state folder: export, import, clear."""
import json
import os
import shutil
import unittest
from pathlib import Path

from journal_daemon import ROOM, JournalTest


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

    def test_a_mission_is_not_imported_into_itself(self):
        self.fill()
        good = self.file("good")
        self.assertEqual(self.mission("export", good, "--state", self.state())[0], 0)
        for copy in (self.state(), good):
            code, _, wrong = self.mission("import", copy, "--state", self.state())
            self.assertEqual(code, 1)
            self.assertIn("goes on with", wrong)
        # Taken in before there was a mission, by hand, ...: an older copy is no other mission.
        shutil.copy(os.path.join(good, "mission.journal"), os.path.join(self.state(), "x.imported"))
        listed = self.listed()
        self.run_service("--pace", "recorded")
        maplets = json.loads(self.ctl("maplets", "--json")[1])
        self.assertEqual(sum(m["id"] < listed["maplets"] for m in maplets), listed["maplets"])
        self.assertIn("journal   on", self.ctl("status")[1])
        self.assertIn("of 1 earlier start(s)", self.stop()[2])

    def test_nothing_is_imported_while_a_clear_waits(self):
        self.fill()
        good = self.file("good")
        self.assertEqual(self.mission("export", good, "--state", self.state())[0], 0)
        with open(os.path.join(self.state(), "clear-at-start"), "w", encoding="utf-8"):
            pass
        code, _, wrong = self.mission("import", good, "--state", self.state())
        self.assertEqual(code, 1)
        self.assertIn("a clear waits", wrong)

    def test_clear_begins_a_new_mission(self):
        listed = self.fill()
        code, said, wrong = self.mission("clear", "--state", self.state())
        self.assertEqual((code, said.strip()), (0, "cleared"), wrong)
        self.assertEqual(self.mission("list", "--state", self.state())[0], 1)
        self.run_service()  # in fast pace, too
        self.assertNotEqual(self.status()["epoch"], listed["epoch"])

    def test_a_folder_without_a_mission_is_not_cleared(self):
        os.makedirs(self.state())
        code, _, wrong = self.mission("clear", "--state", self.state())
        self.assertEqual(code, 1)
        self.assertIn("holds no mission", wrong)
        self.assertEqual(os.listdir(self.state()), [])

    def test_a_running_daemon_is_asked(self):
        self.run_service()
        self.until_flushed(2)
        code, said, wrong = self.ctl("mission", "list", "--json")
        self.assertEqual(code, 0, wrong)
        self.assertGreaterEqual(json.loads(said)["flushed"]["maplets"], 2)
        code, said, wrong = self.ctl("mission", "clear")
        self.assertEqual(code, 0, wrong)
        self.assertIn("next start", said)
        self.assertTrue(self.journal()["clear_at_start"])
        self.assertIn("next start removes", self.ctl("mission", "list")[1])
        self.stop()
        self.assertTrue(self.listed()["clear_at_start"])
        os.path.exists(self.file("socket")) and os.remove(self.file("socket"))
        self.run_service()
        self.assertEqual(len(self.listed()["parts"]), 1)


if __name__ == "__main__":
    unittest.main()
