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

    def run_agent(self, number, *settings, user=None):
        """A short run. @return exit code and standard error"""
        command = [str(BIN / "mapletd"), "--agent", str(number), "--source",
                   "sim:room?width=160&frames=3", "--out", f"{self.dir}/out", "--pace", "fast"]
        for setting in (f"security.keys={self.dir}/team/agent-1", "security.mode=sealed",
                        "exchange.linger_s=0", *settings):
            command += ["--set", setting]
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
        self.assertIn("revoked the keys of agent 3", said)

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
        self.assertEqual(self.run_agent(1, "security.keys=/nowhere")[0], 2)
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
