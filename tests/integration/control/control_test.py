#!/usr/bin/env python3
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""A running daemon is asked over its socket; two daemons on loopback exchange records."""
import json
import os
import random
import signal
import socket
import subprocess
import tempfile
import time
import unittest
from pathlib import Path

BIN = Path(os.environ["MAPLET_BIN_DIR"])
PATIENCE_S = 180.0 if "MAPLET_SANITIZED" in os.environ else 60.0
SOURCE = "sim:loop?seed=7&width=160&rate_hz=10&frames={1}&agent={0}&phase=0.{0}"


def multiply(p, q):
    """Of quaternions x, y, z, w."""
    (a, b, c, d), (e, f, g, h) = p, q
    return [d * e + a * h + b * g - c * f, d * f - a * g + b * h + c * e,
            d * g + a * f - b * e + c * h, d * h - a * e - b * f - c * g]


def relative(T_m_a, T_m_b):
    """T_a_b, of poses x, y, z, qx, qy, qz, qw."""
    back = [-T_m_a[3], -T_m_a[4], -T_m_a[5], T_m_a[6]]
    apart = [b - a for a, b in zip(T_m_a[:3], T_m_b[:3])] + [0.0]
    turned = multiply(multiply(back, apart), T_m_a[3:])
    return turned[:3] + multiply(back, T_m_b[3:])


class Control(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix="maplet-control-")
        self.domain = random.randrange(20, 220)
        self.daemons = []

    def tearDown(self):
        for daemon in self.daemons:
            if daemon.poll() is None:
                daemon.kill()
            daemon.communicate()

    def path(self, agent):
        return f"{self.folder}/{agent}.sock"

    def start(self, agent, name=None, *more, frames=200):
        daemon = subprocess.Popen(
            [str(BIN / "mapletd"), "--agent", str(agent), "--source", SOURCE.format(agent % 10, frames),
             "--set", f"dds.domain={self.domain}",
             "--set", f"control.socket={self.path(name or agent)}",
             "--set", "dds.budget_bytes_per_s=50000", *more],
            stderr=subprocess.PIPE, text=True)
        self.daemons.append(daemon)
        self.until(lambda: os.path.exists(self.path(name or agent)))
        return daemon

    def until(self, condition):
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            try:
                if condition():
                    return
            except (OSError, ValueError):
                pass
            time.sleep(0.1)
        self.fail("did not happen in time")

    def ctl(self, agent, *words, code=0):
        done = subprocess.run([str(BIN / "mapletctl"), *words, "--socket", self.path(agent)],
                              capture_output=True, text=True, timeout=PATIENCE_S)
        self.assertEqual(done.returncode, code, done.stderr)
        return done.stdout if code == 0 else done.stderr

    def status(self, agent):
        return json.loads(self.ctl(agent, "status", "--json"))

    def test_two_daemons_hold_the_same_and_say_so(self):
        for agent in (1, 2):
            self.start(agent)
        self.until(lambda: self.status(1)["exchange"]["records"] >= 4 and
                   self.status(1)["skeleton"]["records_digest"] ==
                   self.status(2)["skeleton"]["records_digest"])
        # What the ledger holds enters the skeleton with the next step: theirs, too.
        self.until(lambda: self.status(1)["skeleton"]["nodes"] > self.status(1)["maplets"])
        status = self.status(1)
        for key in ("state", "frames", "stages", "memory", "tracking", "skeleton", "peers",
                    "journal"):
            self.assertIn(key, status)
        self.assertEqual([p["agent"] for p in json.loads(self.ctl(1, "peers", "--json"))], [2])
        why = json.loads(self.ctl(1, "why", "2", "--json"))
        self.assertTrue(why["heard"])
        self.assertGreater(why["maplets_in_skeleton"], 0)
        self.assertIn("agent 2", self.ctl(1, "status"))
        self.assertIsInstance(json.loads(self.ctl(1, "closure", "list", "--json")), list)
        nobody = json.loads(self.ctl(1, "why", "77", "--json"))
        self.assertFalse(nobody["heard"])
        self.assertIn("never heard", nobody["reason"])
        for daemon in self.daemons:
            daemon.terminate()
        self.assertEqual([daemon.wait(20) for daemon in self.daemons], [0, 0])
        self.assertFalse(os.path.exists(self.path(1)))

    def settled_alike(self):
        """Both have settled on the same records, with the same closures and poses."""
        statuses = [self.status(agent) for agent in (1, 2)]
        if not all(s["skeleton"]["settled"] for s in statuses):
            return False
        for word in ("records_digest", "digest"):
            if len({s["skeleton"][word] for s in statuses}) != 1:
                return False
        maps, verdicts = [], []
        for agent in (1, 2):
            maps.append({(m["agent"], m["epoch"], m["id"]): m["T_map_maplet"]
                         for m in json.loads(self.ctl(agent, "maplets", "--json"))})
            verdicts.append(sorted(
                (json.dumps(c["a"]), json.dumps(c["b"]), c["length_m"], c["rejected"])
                for c in json.loads(self.ctl(agent, "closure", "list", "--json"))))
        self.assertEqual(verdicts[0], verdicts[1])
        common = set(maps[0]) & set(maps[1])  # a lone maplet is its agent's alone
        self.assertGreaterEqual(len(common), 6)
        for key in common:
            for x, y in zip(maps[0][key], maps[1][key]):
                self.assertAlmostEqual(x, y, delta=1e-4)
        return True

    def test_killed_agents_come_back_and_all_settle_alike(self):
        running = {agent: self.start(agent) for agent in (1, 2)}
        self.until(lambda: self.status(1)["exchange"]["received"] > 0)
        for victim in (2, 1, 2):
            time.sleep(2.0)
            running[victim].kill()
            running[victim].wait()
            self.assertIsNone(running[3 - victim].poll())
            os.unlink(self.path(victim))
            running[victim] = self.start(victim)
        self.until(lambda: self.status(1)["frames"]["read"] >= 200 and
                   self.status(2)["frames"]["read"] >= 200)
        self.until(self.settled_alike)

    def test_ranges_enter_the_graph_of_both(self):
        for agent in (1, 2):
            # At the robots' pace: they must still be on their way when the last range is measured.
            self.start(agent, None, "--pace", "recorded", frames=2000)
        self.until(lambda: self.status(1)["exchange"]["received"] > 0 and
                   self.status(2)["exchange"]["received"] > 0)
        domain = ("--domain", str(self.domain))
        ctl = [str(BIN / "mapletctl"), "range"]

        def measure(agent, *words, code=0):
            done = subprocess.run([*ctl, str(3 - agent), *words, "--agent", str(agent), *domain],
                                  capture_output=True, text=True, timeout=PATIENCE_S)
            self.assertEqual(done.returncode, code, done.stderr)
        for _ in range(3):  # a radio on either robot measures the same distance
            for agent in (1, 2):
                measure(agent, "7.5", "--sigma", "0.1")
            time.sleep(1.5)
        measure(1, "7.5", "--bearing", "0,0,1", "--angle-sigma", "0.05")
        measure(1, "-3", code=2)
        measure(1, "5", "--sigma", "0", code=2)
        measure(1, "5", "--bearing", "0,0,3", code=2)
        self.until(lambda: self.status(1)["ranges"]["measured"] == 4)

        def placed():
            here, there = self.status(1), self.status(2)
            return (here["ranges"]["placed"] >= 3 and there["ranges"]["placed"] >= 2 and
                    here["exchange"]["records_digest"] == there["exchange"]["records_digest"] and
                    there["exchange"]["own"]["ranges"] == there["ranges"]["placed"])
        self.until(placed)  # when the other's delta-poses span the moments
        held = json.loads(self.ctl(2, "peers", "--json"))[0]["held"]["ranges"]
        self.assertEqual(held, self.status(1)["exchange"]["own"]["ranges"])

    def test_a_closure_is_rejected_and_restored_by_hand(self):
        self.start(1, None, "--no-dds")
        self.until(lambda: len(json.loads(self.ctl(1, "maplets", "--json"))) >= 3)
        # Where the skeleton has them already: x, y, z of the first two maplets in one map.
        first, second = json.loads(self.ctl(1, "maplets", "--json"))[:2]
        self.ctl(1, "closure", "add", "1:0", "1:1",
                 ",".join(map(str, relative(first["T_map_maplet"], second["T_map_maplet"]))))

        def closure():
            found = [c for c in json.loads(self.ctl(1, "closure", "list", "--json"))
                     if (c["a"]["id"], c["b"]["id"]) == (0, 1)]
            self.assertEqual(len(found), 1)
            return found[0]
        self.assertFalse(closure()["rejected"])
        self.assertIn("1 rejected", self.ctl(1, "closure", "reject", "1:0", "1:1"))
        self.until(lambda: closure()["rejected"])
        self.assertIn("1 restored", self.ctl(1, "closure", "restore", "1:0", "1:1"))
        self.until(lambda: not closure()["rejected"])
        self.assertIn("no closure between", self.ctl(1, "closure", "reject", "1:0", "1:2", code=1))
        self.assertIn("does not have both", self.ctl(1, "closure", "reject", "1:0", "9:9", code=1))

    def test_a_planner_asks_for_ways_the_map_and_where_odometry_stands(self):
        self.start(1, None, "--no-dds")
        self.until(lambda: len(json.loads(self.ctl(1, "maplets", "--json"))) >= 4)
        way = json.loads(self.ctl(1, "way", "1:0", "--from", "1:3", "--json"))
        self.assertEqual([m["id"] for m in way["maplets"]], [3, 2, 1, 0])
        steps = [m["T_map_maplet"][:3] for m in way["maplets"]]
        length = sum(sum((a - b) ** 2 for a, b in zip(p, q)) ** 0.5
                     for p, q in zip(steps, steps[1:]))
        self.assertAlmostEqual(way["length_m"], length, places=6)
        self.assertIn("m in the map of 1:0000", self.ctl(1, "way", "1:0"))  # from where it is
        self.assertIn("does not have both", self.ctl(1, "way", "9", code=1))
        self.ctl(1, "way", "somewhere", code=2)

        whole = json.loads(self.ctl(1, "overlay", "--json"))
        self.assertGreaterEqual(whole["maplets"], 4)
        self.assertEqual((whole["missing"], whole["left_out"]), (0, 0))
        self.assertAlmostEqual(sum(p["area_m2"] for p in whole["planes"]), whole["area_m2"], 6)
        for plane in whole["planes"]:  # n.x + d = 0 where it was seen
            at = sum(n * c for n, c in zip(plane["n"], plane["centre"])) + plane["d"]
            self.assertLess(abs(at), 0.02)
        rough = json.loads(self.ctl(1, "overlay", "--fidelity", "0.5", "--json"))
        self.assertLess(len(rough["planes"]), len(whole["planes"]))
        self.assertGreater(rough["area_m2"], 0.4 * whole["area_m2"])

        self.until(lambda: self.status(1)["navigation"]["map"]["agent"] == 1)
        navigation = self.status(1)["navigation"]
        self.assertAlmostEqual(sum(v * v for v in navigation["T_map_odom"][3:]), 1.0, places=6)
        self.assertLess(max(map(abs, navigation["T_map_odom"][:3])), 0.5)  # it hardly drifts yet
        self.assertEqual(navigation["jumps"], 0)

    def test_silence_on_request(self):
        for agent in (1, 2):
            self.start(agent)
        self.until(lambda: self.status(2)["exchange"]["received"] > 0)
        self.ctl(1, "radio", "silent")
        self.until(lambda: self.status(1)["exchange"]["silent"])
        self.ctl(1, "radio", "on")
        self.until(lambda: not self.status(1)["exchange"]["silent"])
        self.ctl(1, "radio", "loud", code=2)

    def test_after_silence_the_others_are_waited_for(self):
        first = self.start(1, None, "--out", f"{self.folder}/out", "--set", "exchange.linger_s=200", frames=100)
        self.ctl(1, "radio", "silent")
        self.until(lambda: self.status(1)["frames"]["processed"] == 100)
        self.ctl(1, "radio", "on")
        self.until(lambda: not self.status(1)["exchange"]["silent"])
        time.sleep(1.0)  # nobody is heard yet
        self.start(2)
        self.until(lambda: self.status(1)["exchange"]["received"] > 0)
        self.daemons[-1].send_signal(signal.SIGTERM)
        self.assertEqual(first.wait(PATIENCE_S), 0)

    def test_two_devices_with_one_number_are_noticed(self):
        self.start(1)
        self.start(1, "double")
        self.start(2)
        self.until(lambda: self.status(2)["exchange"]["conflicting_agent"] == 1)
        self.assertIn("two devices call themselves agent 1", self.ctl(2, "status"))

    def test_bad_questions_get_one_line(self):
        self.start(1)
        for question in (b"nonsense\n", b"{}\n", b'{"command":"fly"}\n', b'{"command":7}\n',
                         b'{"command":"add","agent_a":1}\n', b"\xff\xfe\n",
                         b'{"command":"recorder","out":5}\n', b'{"command":"set","key":5}\n',
                         b'{"command":"radio","state":null}\n', b'{"command":"set","key":"\xff"}\n',
                         b'{"command":"way","agent_b":65537,"id_b":0}\n',
                         b'{"command":"decide","agent_a":65537,"id_a":0,"agent_b":1,"id_b":1,'
                         b'"accept":false}\n'):
            with socket.socket(socket.AF_UNIX) as link:
                link.settimeout(10)
                link.connect(self.path(1))
                link.sendall(question)
                answer = link.makefile().read()
            self.assertIn("error", json.loads(answer), question)
        self.assertIn("does not have both maplets", self.ctl(
            1, "closure", "add", "1:0", "9:9", "0,0,0,0,0,0,1", code=1))
        self.ctl(1, "closure", "add", "1", "9:9", "0,0,0,0,0,0,1", code=2)
        with socket.socket(socket.AF_UNIX) as silent:  # never says anything
            silent.connect(self.path(1))
            self.assertEqual(self.status(1)["agent"], 1)
        self.assertIn("no mapletd answers", self.ctl("absent", "status", code=1))

    def test_a_taken_socket_is_a_warning(self):
        self.start(1)
        second = subprocess.Popen(
            [str(BIN / "mapletd"), "--agent", "3", "--source", SOURCE.format(3, 200), "--no-dds",
             "--set", f"control.socket={self.path(1)}"], stderr=subprocess.PIPE, text=True)
        self.daemons.append(second)
        self.assertIn("another mapletd answers there", second.stderr.readline())
        self.assertEqual(self.status(1)["agent"], 1)

    def test_a_socket_that_a_killed_daemon_left_is_passed_over(self):
        for folder in ("left", "mapletd"):
            os.mkdir(os.path.join(self.folder, folder))
        with socket.socket(socket.AF_UNIX) as left:
            left.bind(os.path.join(self.folder, "left/agent-61234.sock"))
        self.start(61234, "mapletd/agent-61234")
        done = subprocess.run(
            [str(BIN / "mapletctl"), "status", "--agent", "61234", "--json"], check=False,
            capture_output=True, text=True, timeout=PATIENCE_S, env=dict(
                os.environ, RUNTIME_DIRECTORY=os.path.join(self.folder, "left"),
                XDG_RUNTIME_DIR=self.folder))
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(json.loads(done.stdout)["agent"], 61234)

    def test_a_file_at_the_sockets_path_stays(self):
        notes = Path(self.folder, "notes")
        notes.write_text("mine", encoding="utf-8")
        run = subprocess.Popen(
            [str(BIN / "mapletd"), "--source", SOURCE.format(3, 200), "--no-dds",
             "--set", f"control.socket={notes}"], stderr=subprocess.PIPE, text=True)
        self.daemons.append(run)
        self.assertIn("no socket", run.stderr.readline())
        self.assertEqual(notes.read_text(encoding="utf-8"), "mine")


if __name__ == "__main__":
    unittest.main(verbosity=2)
