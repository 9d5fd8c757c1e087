#!/usr/bin/env python3
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""The daemon's life with a journal: resume, disks of every kind, other agents' and other versions."""
import json
import os
import shutil
import subprocess
import sys
import unittest
from pathlib import Path

from journal_daemon import ROOM, JournalTest, daemon

LONG = "sim:room?seed=3&width=160&frames=9000"
LOOP = "sim:loop?seed=3&width=320&frames=900"
DISK = os.environ.get("MAPLET_DISK_LIBRARY", "")
SLOW = 10 if "MAPLET_SANITIZED" in os.environ else 1


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

    def relations(self, listed):
        """Where the maplets of the first part lie to their gauge, as the daemon has it."""
        return {m["id"]: m["T_map_maplet"] for m in json.loads(self.ctl("maplets", "--json")[1])
                if m["id"] < listed["maplets"]}

    def test_a_wrong_join_overwrites_nothing(self):
        listed = self.fill()
        good = self.file("before")
        self.assertEqual(self.mission("export", good, "--state", self.state())[0], 0)
        # Not another room of the same builder: those are alike enough for closures of their own.
        self.run_service(source="sim:loop?seed=7&width=160&frames=400")
        self.until(lambda: self.status()["maplets"] > 1)
        self.until(lambda: self.status()["skeleton"]["settled"])
        self.assertEqual(self.status()["closures"], 0)
        apart = self.relations(listed)
        new = listed["maplets"]
        for _ in range(2):  # said twice, nonsense both times
            self.ctl("closure", "add", "0:0", f"0:{new}", "7,-5,3,0.5,0.5,0.5,0.5")
        self.until(lambda: self.status()["skeleton"]["settled"])
        code, said, wrong = self.ctl("closure", "reject", "0:0", f"0:{new}")
        self.assertEqual(code, 0, said + wrong)
        self.until(lambda: self.status()["skeleton"]["settled"])
        for maplet, pose in self.relations(listed).items():
            for a, b in zip(pose, apart[maplet]):
                self.assertAlmostEqual(a, b, delta=1e-4)
        self.assertEqual(self.stop()[0], 0)
        again = self.file("after")
        self.assertEqual(self.mission("export", again, "--state", self.state())[0], 0)
        for maplet in Path(good, "maplets").iterdir():
            self.assertEqual(maplet.read_bytes(), Path(again, "maplets", maplet.name).read_bytes())
        lines = Path(again, "delta_poses.jsonl").read_text(encoding="utf-8").splitlines()
        for line in Path(good, "delta_poses.jsonl").read_text(encoding="utf-8").splitlines():
            self.assertIn(line, lines)
        before, after = ({line.split()[0]: [float(x) for x in line.split()[1:]] for line in
                          Path(out, "trajectory.tum").read_text(encoding="utf-8").splitlines()}
                         for out in (good, again))
        self.assertGreater(len(before), 5)
        for stamp, pose in before.items():  # solved beside another part: not to the last bit
            for a, b in zip(pose, after[stamp]):
                self.assertAlmostEqual(a, b, delta=1e-4)

    def test_without_a_state_directory_there_is_no_journal(self):
        self.start("--source", ROOM, environment={"STATE_DIRECTORY": ""})
        self.until(lambda: os.path.exists(self.file("socket")))
        self.assertEqual(self.journal(), {"state": "off", "flushed": {}, "problem": "", "directory": "",
                                          "clear_at_start": False})
        self.assertEqual(self.status()["recorder"], {"state": "off", "file": ""})

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
        os.remove(os.path.join(self.state(), "lock"))  # by somebody who tidies up
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
        self.assertNotEqual(self.journal()["problem"], "")
        _, _, said = self.stop()
        self.assertIn("goes on in memory", said)

    @unittest.skipUnless(DISK, "no mocked disk under a sanitizer")
    def test_a_disk_without_room_is_memory_alone(self):
        Path(self.file("mood")).write_text("f", encoding="utf-8")
        self.run_service(environment={"LD_PRELOAD": DISK, "MAPLET_DISK": self.file("mood")})
        self.assertEqual(self.journal()["state"], "off")
        self.assertIn("No space left", self.journal()["problem"])
        self.until(lambda: self.status()["maplets"] > 1)
        _, _, said = self.stop()
        self.assertIn("No space left", said)

    @unittest.skipUnless(DISK, "no mocked disk under a sanitizer")
    def test_a_disk_that_breaks_is_tried_again(self):
        self.run_service("--pace", "recorded", source=LONG,
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

    def breaks(self, mood, word):
        """A disk that takes no more after a while, and does again."""
        self.run_service("--pace", "recorded", source=LONG,
                         environment={"LD_PRELOAD": DISK, "MAPLET_DISK": self.file("mood")})
        self.until_flushed(1)
        Path(self.file("mood")).write_text(mood, encoding="utf-8")
        self.until(lambda: self.journal()["state"] == "waiting")
        self.assertIn(word, self.journal()["problem"])
        before = self.status()["frames"]["processed"]
        self.until(lambda: self.status()["frames"]["processed"] > before + 10)
        os.remove(self.file("mood"))
        self.until(lambda: self.journal()["state"] == "on")
        self.stop()
        self.assertEqual(sum(self.listed()["missing"].values()), 0)

    @unittest.skipUnless(DISK, "no mocked disk under a sanitizer")
    def test_a_disk_that_becomes_read_only(self):
        self.breaks("r", "Read-only")

    @unittest.skipUnless(DISK, "no mocked disk under a sanitizer")
    def test_a_disk_that_fills_up(self):
        self.breaks("f", "No space")

    @unittest.skipUnless(DISK, "no mocked disk under a sanitizer")
    def test_a_slow_disk_holds_nobody_up(self):
        """Each flush stalls for 2 s; the stage that hands over to the journal takes no longer."""
        handed_over = {}
        for mood in ("", "s"):
            Path(self.file("mood")).write_text(mood, encoding="utf-8")
            self.run_service("--pace", "recorded", source=LONG,
                             environment={"LD_PRELOAD": DISK, "MAPLET_DISK": self.file("mood")})
            self.until_flushed(4)
            status = self.status()
            self.assertEqual(status["journal"]["state"], "on")
            self.assertEqual(status["memory"]["heap_allocations_after_ready"], 0)
            handed_over[mood] = status["stages"]["exchange"]
            self.stop()
            shutil.rmtree(self.state())
        print(f"handing over, no stall: {handed_over['']}; 2 s stalls: {handed_over['s']}",
              file=sys.stderr)
        # Wall time on whatever machine this is: a wait for the disk would be seconds.
        self.assertLess(handed_over["s"]["max_us"], 100_000)

    def test_a_folder_removed_under_the_daemon(self):
        self.run_service("--pace", "recorded", source=LONG)
        self.until_flushed(1)
        shutil.rmtree(self.state())
        self.until(lambda: self.journal()["state"] == "removed")
        self.assertEqual(self.journal()["flushed"].get("maplets", 0), 0)
        epoch = self.status()["epoch"]
        before = self.status()["maplets"]
        self.until(lambda: self.status()["maplets"] > before)
        self.assertEqual(self.journal()["held_back"], 0)
        code, _, said = self.stop()
        self.assertEqual(code, 0)
        self.assertIn("was removed", said)
        self.run_service("--pace", "recorded")  # another mission
        self.assertNotEqual(self.status()["epoch"], epoch)
        self.assertEqual(self.journal()["state"], "on")

    def test_a_folder_moved_under_the_daemon(self):
        self.run_service("--pace", "recorded", source=LONG)
        self.until_flushed(1)
        epoch = self.status()["epoch"]
        away = self.file("away")
        os.rename(self.state(), away)
        self.until(lambda: self.journal()["state"] == "moved")
        self.assertEqual(self.journal()["flushed"].get("maplets", 0), 0)
        self.assertIn("moved", self.journal()["problem"])
        before = self.listed(away)["maplets"]
        self.until(lambda: self.listed(away)["maplets"] > before)
        os.rename(away, self.state())
        self.until(lambda: self.journal()["state"] == "on")
        self.until_flushed(before)
        ended, self.daemon = self.daemon, None
        ended.kill()
        _, said = ended.communicate()
        self.assertIn("was moved", said)
        self.assertIn("is back", said)
        listed = self.listed()
        self.assertEqual(sum(listed["missing"].values()), 0)
        self.assertEqual(listed["epoch"], epoch)

    @unittest.skipUnless(daemon.may_mount(), "no private mounts here")
    def test_a_mission_on_a_read_only_disk_is_not_said_to_be_cleared(self):
        self.fill()
        done = subprocess.run(
            ["unshare", "-Urm", "sh", "-c", f'mount --bind {self.state()} {self.state()} && '
             f'mount -o remount,bind,ro {self.state()} && exec "$@"', "sh",
             str(daemon.BIN / "mapletctl"), "mission", "clear", "--state", self.state()],
            capture_output=True, text=True, timeout=daemon.PATIENCE_S)
        self.assertEqual(done.returncode, 1, done.stdout)
        self.assertIn("Read-only file system", done.stderr)
        self.assertGreater(self.listed()["maplets"], 0)

    @unittest.skipUnless(daemon.may_mount(), "no private mounts here")
    def test_a_read_only_folder_is_shown_and_left(self):
        listed = self.fill()
        content = Path(self.state(), "mission.journal").read_bytes()
        self.run_service("--pace", "recorded", wrapper=(
            "unshare", "-Urm", "sh", "-c",
            f'mount --bind {self.state()} {self.state()} && '
            f'mount -o remount,bind,ro {self.state()} && exec "$@"', "sh"))
        self.assertEqual(self.journal()["state"], "off")
        self.assertIn("Read-only file system", self.journal()["problem"])
        self.assertNotEqual(self.status()["epoch"], listed["epoch"])
        maplets = json.loads(self.ctl("maplets", "--json")[1])
        self.assertEqual(sum(m["epoch"] == listed["epoch"] for m in maplets), listed["maplets"])
        self.until(lambda: self.status()["maplets"] > 1)
        code, _, said = self.stop()
        self.assertEqual(code, 0)
        self.assertIn("Read-only file system; the mission goes on in memory", said)
        self.assertEqual(Path(self.state(), "mission.journal").read_bytes(), content)

    @unittest.skipUnless(daemon.may_mount(), "no private mounts here")
    def test_a_disk_that_is_too_small(self):
        os.makedirs(self.state())
        self.run_service("--pace", "recorded", wrapper=(
            "unshare", "-Urm", "sh", "-c",
            f'mount -t tmpfs -o size=2m none {self.state()} && exec "$@"', "sh"))
        self.assertEqual(self.journal()["state"], "off")
        self.until(lambda: self.status()["maplets"] > 1)
        code, _, said = self.stop()
        self.assertEqual(code, 0)
        self.assertIn("no room for 8 MiB (No space left on device)", said)


if __name__ == "__main__":
    unittest.main()
