#!/usr/bin/env python3
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""mapletctl keys, and what mapletd says of keys that it cannot use."""
import json
import os
import re
import stat
import subprocess
import tempfile
import time
import unittest
from pathlib import Path

BIN = Path(os.environ.get("MAPLET_BIN_DIR", "build/dev/bin"))


class Keys(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory(prefix="maplet-keys-")
        self.addCleanup(self.folder.cleanup)
        self.dir = self.folder.name

    def keys(self, *words, code=0):
        done = subprocess.run([BIN / "mapletctl", "keys", *words], cwd=self.dir, text=True,
                              capture_output=True)
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done.stdout if code == 0 else done.stderr

    def run_agent(self, number, *settings, user=None, words=()):
        """A short run. @return exit code and standard error"""
        command = [str(BIN / "mapletd"), "--agent", str(number), "--source",
                   "sim:room?width=160&frames=3", "--out", f"{self.dir}/out", "--pace", "fast"]
        for setting in (f"security.keys={self.dir}/team/agent-1", "security.mode=sealed",
                        "exchange.linger_s=0", *settings):
            command += ["--set", setting]
        command += map(str, words)
        if user is not None:
            command = ["setpriv", f"--reuid={user}", "--clear-groups", *command]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60)
        return done.returncode, done.stderr

    def make_team(self, *init):
        self.keys("init", *init)
        self.keys("agent", "1")
        self.keys("agent", "2")

    def mode(self, path):
        return stat.S_IMODE(os.stat(f"{self.dir}/{path}").st_mode)

    def test_makes_what_nobody_else_reads(self):
        self.make_team()
        for secret in ("team/team.json", "team/ca.key.pem", "team/agent-1/agent.keys",
                       "team/agent-1/identity.key.pem"):
            self.assertEqual(self.mode(secret), 0o600, secret)
        self.assertEqual(self.mode("team"), 0o700)
        team = json.loads(self.keys("show", "--json"))
        self.assertEqual([a["agent"] for a in team["agents"]], [1, 2])
        agent = json.loads(self.keys("show", "team/agent-2", "--json"))
        self.assertEqual((agent["agent"], agent["generation"], agent["team"]),
                         (2, 1, team["team"]))
        said = self.keys("show") + self.keys("show", "team/agent-1") + json.dumps(agent)
        secrets = json.loads(Path(f"{self.dir}/team/team.json").read_text())
        self.assertNotIn(secrets["group_key"], said)
        chain = subprocess.run(["openssl", "verify", "-CAfile", "team/ca.pem",
                                "team/agent-1/identity.pem"], cwd=self.dir, capture_output=True)
        self.assertEqual(chain.returncode, 0, chain.stderr)
        self.assertEqual(self.run_agent(1)[0], 0)

    def test_revokes_and_renews(self):
        self.make_team()
        self.keys("agent", "3")
        done = json.loads(self.keys("revoke", "3", "--json"))
        self.assertEqual((done["generation"], done["revoked"], done["robots"]), (2, [3], 2))
        notice = json.loads(self.keys("show", "team/newest.notice", "--json"))
        self.assertEqual((notice["agents"], notice["revoked"]), ([1, 2], [3]))
        self.assertIn("number", self.keys("agent", "3", code=1))
        self.assertIn("has no keys", self.keys("revoke", "7", code=1))
        self.assertIn("--renew", self.keys("agent", "1", code=1))
        self.keys("agent", "1", "--renew")
        self.assertEqual(json.loads(self.keys("show", "team/agent-1", "--json"))["generation"], 2)
        revoked = subprocess.run(["openssl", "verify", "-crl_check", "-CAfile", "team/ca.pem",
                                  "-CRLfile", "team/crl.pem", "team/agent-3/identity.pem"],
                                 cwd=self.dir, capture_output=True, text=True)
        self.assertIn("revoked", revoked.stdout + revoked.stderr)
        # The notice beside the keys is taken at the next start; the revoked one does not start.
        for number in (2, 3):
            os.rename(f"{self.dir}/team/agent-{number}", f"{self.dir}/agent-{number}")
            Path(f"{self.dir}/agent-{number}/newest.notice").write_bytes(
                Path(f"{self.dir}/team/newest.notice").read_bytes())
        self.assertEqual(self.run_agent(2, f"security.keys={self.dir}/agent-2")[0], 0)
        code, said = self.run_agent(3, f"security.keys={self.dir}/agent-3")
        self.assertEqual(code, 1)
        self.assertRegex(said, "revoked the keys of agent 3.*another number")

    def contents(self, folder):
        return {str(p): p.read_bytes() for p in Path(self.dir, folder).rglob("*") if p.is_file()}

    def refused(self, *words, says, keeps, code=1):
        """The command fails with `says`, and nothing in the folders is another one after it."""
        before = [self.contents(folder) for folder in keeps]
        self.assertRegex(self.keys(*words, code=code), says)
        self.assertEqual(before, [self.contents(folder) for folder in keeps])

    def test_no_keys_are_written_over(self):
        self.make_team()
        self.keys("init", "--team", "other")
        self.keys("agent", "7", "--team", "other")
        for where, says in (("team/agent-1", "the keys of agent 1"), ("team", "a team's own file"),
                            ("other", "a team's own file"), ("other/agent-7", "another team")):
            for renew in ([], ["--renew"]):
                self.refused("agent", "20", "--out", where, *renew, says=says,
                             keeps=["team", "other"])
        self.refused("agent", "7", "--out", "other/agent-7", says="another team",
                     keeps=["team", "other"])
        os.remove(f"{self.dir}/other/agent-7/agent.keys")
        self.refused("agent", "7", "--out", "other/agent-7", "--renew", says="certificate",
                     keeps=["team", "other"])
        os.remove(f"{self.dir}/other/team.json")
        self.refused("init", "--team", "other", says="ca.key.pem: is there already", keeps=["other"])
        self.refused("init", "--team", "team/agent-1", says="is there already", keeps=["team"])
        for name in ("", "x" * 5000, "a\nb", b"\xff\xfe"):
            self.refused("init", "--team", "new", "--name", name, says="--name", keeps=["team"],
                         code=2)
        # What was begun and not ended can be ended.
        os.remove(f"{self.dir}/team/agent-2/agent.keys")
        self.keys("agent", "2", "--renew")
        self.assertEqual(json.loads(self.keys("show", "team/agent-2", "--json"))["agent"], 2)

    def test_a_revocation_is_whole_or_not_at_all_and_can_be_repeated(self):
        self.make_team()
        self.keys("agent", "3")
        key = Path(f"{self.dir}/team/ca.key.pem")
        good = key.read_text()
        other = subprocess.run(["openssl", "ecparam", "-name", "prime256v1", "-genkey", "-noout"],
                               capture_output=True, text=True).stdout
        for text in ("", good[:100], other, None):
            key.unlink()
            if text is not None:
                key.write_text(text)
                key.chmod(0o600)
            for words in (["revoke", "3"], ["agent", "4"]):
                self.refused(*words, says="ca.key.pem: .*restore", keeps=["team"])
            key.write_text(good)
            key.chmod(0o600)
        self.keys("revoke", "3")
        for file in ("newest.notice", "crl.pem"):
            os.remove(f"{self.dir}/team/{file}")
        self.assertIn("written again: generation 2", self.keys("revoke", "3"))
        done = json.loads(self.keys("revoke", "3", "3", "--json"))
        self.assertEqual((done["generation"], done["again"]), (2, True))
        self.assertTrue(os.path.exists(f"{self.dir}/team/crl.pem"))
        notice = json.loads(self.keys("show", "team/newest.notice", "--json"))
        self.assertEqual((notice["generation"], notice["agents"], notice["revoked"]),
                         (2, [1, 2], [3]))
        done = json.loads(self.keys("revoke", "3", "2", "--json"))
        self.assertEqual((done["generation"], done["robots"], done["again"]), (3, 1, False))

    def lose_robot_3(self):
        """A team that has revoked it; its notice and an empty folder for an agent's state."""
        self.make_team()
        self.keys("agent", "3")
        self.keys("revoke", "3")
        state = Path(f"{self.dir}/state")
        state.mkdir()
        return Path(f"{self.dir}/team/newest.notice").read_bytes(), state

    def test_nothing_goes_back_before_a_revocation(self):
        good, state = self.lose_robot_3()
        for folder in (Path(f"{self.dir}/team/agent-1"), state):
            for text in (b"", os.urandom(300), good[:200], good[:-30], b"A".join(good.split(b"M", 1))):
                (folder / "newest.notice").write_bytes(text)
                code, said = self.run_agent(1, words=["--state", state])
                self.assertEqual(code, 2, said)
                self.assertIn(f"{folder}/newest.notice: ", said)
                self.assertRegex(said, "damaged.*put the team.s newest.notice there")
                if folder != state:
                    self.keys("show", "team/agent-1", code=1)
            (folder / "newest.notice").write_bytes(good)
            self.assertEqual(self.run_agent(1, words=["--state", state])[0], 0)
        # What was heard from beside the keys is kept with the mission, too.
        (state / "newest.notice").unlink()
        self.run_agent(1, words=["--state", state])
        self.assertIn(b"KEY NOTICE", (state / "newest.notice").read_bytes())
        os.chmod(f"{self.dir}/team/agent-1", 0o777)
        code, said = self.run_agent(1)
        self.assertEqual(code, 2)
        self.assertRegex(said, "agent-1: others may write in it.*chmod 700")

    def check(self, agent, *words):
        done = subprocess.run([BIN / "mapletctl", "check", "--json", "--source", "sim:room", "--set",
                               "security.mode=sealed", "--set",
                               f"security.keys={self.dir}/team/agent-{agent}", *words],
                              capture_output=True, text=True)
        return next(row for row in json.loads(done.stdout) if row["name"] == "security")

    def test_show_and_check_say_what_the_daemon_will(self):
        good, state = self.lose_robot_3()
        (state / "newest.notice").write_bytes(good)
        self.assertIn("generation 1", self.check(1)["detail"])
        self.assertIn("generation 2", self.check(1, "--state", state)["detail"])
        self.assertEqual(self.check(3, "--state", state)["result"], "FAIL")
        for agent in (1, 3):
            Path(f"{self.dir}/team/agent-{agent}/newest.notice").write_bytes(good)
        self.assertIn("generation 2", self.check(1)["detail"])
        self.assertIn("revoked the keys of agent 3", self.check(3)["detail"])
        self.assertIn("another number", self.check(3)["remedy"])
        shown = [json.loads(self.keys("show", f"team/agent-{a}", "--json")) for a in (1, 3)]
        self.assertEqual([(s["generation"], s["state"], s["notice"]) for s in shown],
                         [(2, "good", 2), (1, "revoked", 2)])
        self.assertRegex(self.keys("show", "team/agent-3"), "generation 1, revoked")

    def test_a_running_agent_that_is_revoked_is_told_so(self):
        self.make_team()
        self.keys("revoke", "1")
        socket = f"{self.dir}/1.sock"
        daemon = subprocess.Popen([BIN / "mapletd", "--agent", "1", "--source", "sim:room?width=160",
                                   "--set", f"control.socket={socket}", "--set",
                                   f"security.keys={self.dir}/team/agent-1", "--set",
                                   "security.mode=sealed"], stderr=subprocess.DEVNULL)
        self.addCleanup(daemon.wait)
        self.addCleanup(daemon.terminate)
        for _ in range(100):
            if os.path.exists(socket):
                break
            time.sleep(0.1)
        status = subprocess.run([BIN / "mapletctl", "status", "--json", "--socket", socket],
                                capture_output=True, text=True)
        self.assertEqual(json.loads(status.stdout)["security"]["mode"], "sealed")
        for word in ("taken", "known"):
            said = self.keys("load", "team/newest.notice", "--socket", socket)
            self.assertIn(f"{word}: generation 2 revokes the keys of agent 1", said)

    def test_says_what_is_wrong_with_files(self):
        self.make_team()
        file = Path(f"{self.dir}/team/agent-1/agent.keys")
        good = file.read_text()
        os.chmod(file, 0o644)
        code, said = self.run_agent(1)
        self.assertEqual(code, 2)
        self.assertRegex(said, "others may read it .mode 0644.: chmod 600")
        os.chmod(file, 0o600)
        for text in (good[:60], good.replace("A", "B", 5), "", "\0" * 100, good + good):
            file.write_text(text)
            code, said = self.run_agent(1)
            self.assertEqual(code, 2, said)
            self.assertRegex(said, "agent.keys: (truncated|damaged|made by)")
            self.assertEqual(said.count("\n"), 1)
        file.write_text(good)
        code, said = self.run_agent(2)
        self.assertEqual(code, 2)
        self.assertIn("are the keys of agent 1, and this is agent 2", said)
        code, said = self.run_agent(1, "security.keys=/nowhere")
        self.assertEqual(code, 2)
        self.assertIn("/nowhere/agent.keys: is not there: mapletctl keys agent", said)
        self.assertIn("needs keys", self.run_agent(1, "security.keys=")[1])
        self.assertIn("sealed", self.run_agent(1, "security.mode=dds", "dds.profile=radio")[1])
        os.remove(f"{self.dir}/team/agent-1/permissions.p7s")
        code, said = self.run_agent(1, "security.mode=dds", "dds.profile=wifi")
        self.assertEqual(code, 2)
        self.assertIn("permissions.p7s", said)

    @unittest.skipUnless(os.geteuid() == 0, "needs another user")
    def test_says_whose_unreadable_keys_are(self):
        self.make_team()
        os.chmod(self.dir, 0o755)
        code, said = self.run_agent(1, user=65534)
        self.assertEqual(code, 2)
        self.assertRegex(said, "Permission denied.*chown nobody")

    def test_says_both_times_of_dates(self):
        self.make_team("--days", "1")
        for shift, word in (("-2d", "not valid before"), ("+3d", "expired at")):
            code, said = self.with_clock(shift)
            self.assertEqual(code, 1, said)
            self.assertIn(word, said)
            self.assertEqual(len(re.findall(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d UTC", said)), 2, said)
            self.assertIn("tolerance 300 s", said)
            self.assertEqual(self.with_clock(shift, "security.clock_tolerance_s=1000000")[0], 0)

    def with_clock(self, shift, *settings):
        """The keys are as much older or younger: of the machine's clock nothing is changed."""
        days = {"-2d": 2, "+3d": -3}[shift]
        team = json.loads(Path(f"{self.dir}/team/team.json").read_text())
        team["not_before_s"] = int(time.time()) + days * 86400
        team["not_after_s"] = team["not_before_s"] + 86400
        Path(f"{self.dir}/team/team.json").write_text(json.dumps(team))
        self.keys("agent", "1", "--renew")
        return self.run_agent(1, *settings)

    def test_team_folders_are_kept(self):
        self.make_team()
        self.assertIn("is there already", self.keys("init", code=1))
        self.assertIn("keys init", self.keys("agent", "5", "--team", "elsewhere", code=1))
        os.chmod(f"{self.dir}/team/team.json", 0o640)
        self.assertIn("chmod 600", self.keys("agent", "5", code=1))
        os.chmod(f"{self.dir}/team/team.json", 0o600)
        Path(f"{self.dir}/team/team.json").write_text("{}")
        self.assertIn("damaged", self.keys("agent", "5", code=1))


if __name__ == "__main__":
    unittest.main(verbosity=2)
