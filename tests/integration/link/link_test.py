#!/usr/bin/env python3
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""Agents on bad links: mapletd itself, real DDS, a simulated radio channel.

    link_test.py [Case.test]      prints what it measured, a line a figure
"""
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import link_lab  # noqa: E402

BIN = Path(os.environ.get("MAPLET_BIN_DIR", "build/dev/bin"))
# A small world seen by a small camera: what is measured here is the link.
SOURCE = "sim:loop?seed=7&width=160&rate_hz=10&frames={frames}&agent={agent}&phase={phase}"


def say(text, value):
    print(f"    {text}: {value}", flush=True)


def percentile(values, share):
    return sorted(values)[int(share * (len(values) - 1))] if values else float("nan")


class Agent:
    """A mapletd in a namespace."""

    def __init__(self, namespace, folder, frames, *settings):
        self.namespace, self.folder = namespace, folder
        self.number = namespace.number
        self.socket = f"{folder}/{self.number}.sock"
        self.log = open(f"{folder}/{self.number}.log", "a")
        self.frames, self.settings = frames, settings
        self.start()

    def start(self):
        source = SOURCE.format(frames=self.frames, agent=self.number, phase=0.2 * self.number)
        command = [str(BIN / "mapletd"), "--agent", str(self.number), "--source", source,
                   "--pace", "recorded", "--set", "dds.interface=rad0",
                   "--set", f"control.socket={self.socket}"]
        for setting in self.settings:
            command += ["--set", setting]
        self.process = subprocess.Popen(self.namespace.command(*command), stdout=self.log,
                                        stderr=self.log)

    def ask(self, command):
        with socket.socket(socket.AF_UNIX) as link:
            link.settimeout(5)
            link.connect(self.socket)
            link.sendall(json.dumps({"command": command}).encode() + b"\n")
            answer = b""
            while chunk := link.recv(65536):
                answer += chunk
        return json.loads(answer)

    def exchange(self):
        """Own records and those held of others, by agent; None while it does not answer."""
        try:
            status = self.ask("status")
        except (OSError, ValueError):
            return None
        return status

    def kill(self):
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()

    def close(self):
        """@return its exit code after SIGTERM."""
        self.process.send_signal(signal.SIGTERM)
        try:
            code = self.process.wait(20)
        except subprocess.TimeoutExpired:
            self.kill()
            code = None
        self.log.close()
        return code


@unittest.skipUnless(link_lab.possible(), "needs root, ip netns and /dev/net/tun")
class Link(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix="maplet-link-")

    def agents(self, lab, frames, *settings):
        made = [Agent(n, self.folder, frames, *settings) for n in lab.namespaces]
        self.addCleanup(lambda: [a.process.poll() is None and a.kill() for a in made])
        return made

    def watch(self, agents, seconds, made=None, heard=None):
        """Notes when each own delta-pose was there, and when each other agent held it."""
        made = {} if made is None else made
        heard = {} if heard is None else heard
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            for agent in agents:
                status = agent.exchange()
                if not status:
                    continue
                now = time.monotonic()
                own = (agent.number, status["epoch"])
                for seq in range(status["exchange"]["own"]["delta_poses"]):
                    made.setdefault((own, seq), now)
                for peer in status["peers"]:
                    other = (peer["agent"], peer["epoch"])
                    for seq in range(peer["held"]["delta_poses"]):
                        heard.setdefault((other, seq, agent.number), now)
            time.sleep(0.2)
        return made, heard

    def latencies(self, agents, made, heard):
        late = []
        for (life, seq), at in made.items():
            others = [a.number for a in agents if a.number != life[0]]
            times = [heard.get((life, seq, number)) for number in others]
            late.append(max(times) - at if all(times) else float("inf"))
        return late

    def wait_for_sync(self, agents, limit_s):
        """@return seconds until all report the same records digest."""
        start = time.monotonic()
        while time.monotonic() - start < limit_s:
            found = [a.exchange() for a in agents]
            if all(found):
                words = {s["exchange"]["records_digest"] for s in found}
                if len(words) == 1 and all(s["exchange"]["records"] > 0 for s in found):
                    return time.monotonic() - start
            time.sleep(0.1)
        return float("inf")

    def finish(self, agents):
        self.assertEqual([a.close() for a in agents], [0] * len(agents))

    def test_wifi_64_kbit_with_30_percent_loss(self):
        budget = 2000
        with link_lab.Lab(3, rate_bit_s=64000, loss=0.3, delay_s=0.2) as lab:
            start = time.monotonic()
            agents = self.agents(lab, 1500, "dds.profile=wifi", f"dds.budget_bytes_per_s={budget}")
            made, heard = self.watch(agents, 70)
            # A cut of a minute while records are made.
            lab.hub.isolate(3)
            self.watch(agents, 60, made, heard)
            lab.hub.join_all()
            restored = self.wait_for_sync(agents, 60)
            say("in sync after a 60 s cut, s", f"{restored:.1f}")
            self.watch(agents, 30, made, heard)
            before_cut = {k: t for k, t in made.items() if t < start + 55}
            late = self.latencies(agents, before_cut, heard)
            say("delta-poses made before the cut", len(late))
            say("everywhere after, p50 s", f"{percentile(late, 0.5):.1f}")
            say("everywhere after, p95 s, discovery included", f"{percentile(late, 0.95):.1f}")
            met = {k: t for k, t in before_cut.items() if t > start + 20}
            late = self.latencies(agents, met, heard)
            say("everywhere after, p95 s, made later than 20 s", f"{percentile(late, 0.95):.1f}")
            self.wait_for_sync(agents, 30)
            time.sleep(75)  # frames are over: nothing new
            quiet = time.monotonic()
            before = [a.exchange()["exchange"] for a in agents]
            time.sleep(90)
            now = time.monotonic()
            for key in ("dds_bytes", "control_bytes", "maplet_bytes", "delta_pose_bytes"):
                after = [a.exchange()["exchange"][key] - b[key] for a, b in zip(agents, before)]
                say(f"in 90 idle seconds, {key}", after)
            idle = [lab.hub.bytes_between(n, quiet, now) / (now - quiet) for n in (1, 2, 3)]
            worst = [lab.hub.worst_window(n, start + 30, now) / 10 for n in (1, 2, 3)]
            say("idle, IP bytes/s of each", [round(i, 1) for i in idle])
            say(f"worst 10 s of a budget of {budget}, bytes/s", [round(w) for w in worst])
            self.finish(agents)
        self.assertGreater(len(late), 10)  # discovery itself takes up to 16 s at 30 % loss
        self.assertLessEqual(percentile(late, 0.95), 10.0)
        self.assertLessEqual(restored, 5.0)
        self.assertLessEqual(max(idle), 20.0)
        self.assertLessEqual(max(worst), 1.05 * budget)

    def test_radio_9600_bit_with_10_percent_loss(self):
        budget = 300
        with link_lab.Lab(3, rate_bit_s=9600, loss=0.1, delay_s=0.2, queue_bytes=8000) as lab:
            start = time.monotonic()
            agents = self.agents(lab, 1200, "dds.profile=radio",
                                 f"dds.budget_bytes_per_s={budget}")
            made, heard = self.watch(agents, 210)
            now = time.monotonic()
            late = self.latencies(agents, {k: t for k, t in made.items() if t < now - 60}, heard)
            worst = [lab.hub.worst_window(n, start + 30, now) / 10 for n in (1, 2, 3)]
            say("delta-poses", len(late))
            say("everywhere after, p50 s", f"{percentile(late, 0.5):.1f}")
            say("everywhere after, worst s", f"{max(late):.1f}")
            say(f"worst 10 s of a budget of {budget}, bytes/s", [round(w) for w in worst])
            self.finish(agents)
        self.assertGreater(len(late), 5)
        self.assertLessEqual(max(late), 60.0)
        self.assertLessEqual(max(worst), 1.05 * budget)

    def test_relay_without_a_meeting(self):
        with link_lab.Lab(3, rate_bit_s=1e6, delay_s=0.02) as lab:
            lab.hub.cut = {(1, 3), (3, 1), (2, 3), (3, 2)}
            agents = self.agents(lab, 600, "dds.budget_bytes_per_s=20000", "exchange.maplets=none")
            self.assertLess(self.wait_for_sync(agents[:2], 90), 90)
            time.sleep(30)  # all records are made: 60 s of frames
            self.assertLess(self.wait_for_sync(agents[:2], 60), 60)
            lab.hub.cut = {(1, 2), (2, 1), (1, 3), (3, 1)}
            relayed = self.wait_for_sync(agents, 60)
            say("C holds what A made, never heard, after s", f"{relayed:.1f}")
            self.finish(agents)
        self.assertLess(relayed, 60)

    def test_killed_agents_come_back(self):
        rounds = int(os.environ.get("MAPLET_KILLS", "6"))
        with link_lab.Lab(3, rate_bit_s=1e6, delay_s=0.02, loss=0.1) as lab:
            agents = self.agents(lab, 900, "dds.budget_bytes_per_s=20000")
            for i in range(rounds):
                time.sleep(2 + i % 4)
                victim = agents[i % 3]
                victim.kill()
                for other in agents:
                    if other is not victim:
                        self.assertIsNone(other.process.poll())
                victim.start()
            took = self.wait_for_sync(agents, 120)
            say(f"in sync after {rounds} kills, s", f"{took:.1f}")
            self.finish(agents)
        self.assertLess(took, 120)

    def test_interface_that_goes_and_comes(self):
        with link_lab.Lab(2, rate_bit_s=1e6, delay_s=0.02) as lab:
            lab.namespaces[1].unplug()
            agents = self.agents(lab, 300, "dds.budget_bytes_per_s=20000")
            time.sleep(5)
            self.assertFalse(agents[1].exchange()["exchange"]["open"])
            lab.namespaces[1].plug()
            self.assertLess(self.wait_for_sync(agents, 60), 60)
            lab.namespaces[1].unplug()
            time.sleep(4)
            self.assertFalse(agents[1].exchange()["exchange"]["open"])
            lab.namespaces[1].plug()
            took = self.wait_for_sync(agents, 60)
            say("in sync after the interface came back, s", f"{took:.1f}")
            self.assertLess(took, 60)
            lab.namespaces[1].unplug()
            self.finish(agents)  # without its interface, too


if __name__ == "__main__":
    unittest.main(verbosity=2)
