#!/usr/bin/env python3
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""A ROS 2 node as rmw_fastrtps makes one sees what mapletd knows, number by number; and odometry that
it writes carries the track where depth alone cannot."""
import json
import math
import os
import random
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent / "autopilot"))
from autopilot_test import composed, inverse, turned  # noqa: E402

BIN = Path(os.environ["MAPLET_BIN_DIR"])
NODE = str(BIN.parent / "tests" / "fastdds_ros2_node")
PATIENCE_S = 120
BODY_CAMERA = (0.2, 0.0, 0.3, -0.5, 0.5, -0.5, 0.5)
ROOM = "sim:room?frames=240&width=160&gray=0&seed=4"
CORRIDOR = "sim:corridor?frames=240&width=160&gray=0&seed=2&phase=0.1&wobble=0"


def tum(file):
    lines = Path(file).read_text(encoding="utf-8").splitlines()
    words = [line.split() for line in lines if not line.startswith("#")]
    return {round(float(w[0]), 6): tuple(map(float, w[1:8])) for w in words}


def angle(a, b):
    return 2 * math.acos(min(1.0, abs(sum(p * q for p, q in zip(a[3:], b[3:])))))


def area(points):
    total = 0.0
    for i in range(0, len(points), 3):
        a, b, c = points[i:i + 3]
        u = [b[k] - a[k] for k in range(3)]
        v = [c[k] - a[k] for k in range(3)]
        total += 0.5 * math.hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                                  u[0] * v[1] - u[1] * v[0])
    return total


class Ros2(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory(prefix="maplet-ros2-")
        self.domain = random.randrange(20, 220)
        self.children = []

    def tearDown(self):
        for child in self.children:
            if child.poll() is None:
                child.kill()
            child.communicate()
        self.folder.cleanup()

    def file(self, name):
        return os.path.join(self.folder.name, name)

    def daemon(self, source, *settings, out="run"):
        words = [str(BIN / "mapletd"), "--agent", "1", "--source", source, "--pace", "recorded", "--out",
                 self.file(out), "--set", f"dds.domain={self.domain}", "--set",
                 f"control.socket={self.file('socket')}", "--set",
                 "body.T_body_camera=" + ",".join(map(str, BODY_CAMERA))]
        for setting in settings:
            words += ["--set", setting]
        child = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.children.append(child)
        return child

    def node(self, seconds, *more):
        """A node, and the lines that it will have said."""
        child = subprocess.Popen([NODE, str(self.domain), str(seconds), *more],
                                 stdout=subprocess.PIPE, text=True)
        self.children.append(child)
        said = []

        def listen():
            for line in child.stdout:
                said.append(json.loads(line))
        reader = threading.Thread(target=listen, daemon=True)
        reader.start()
        return child, said, reader

    def simulate(self, source):
        subprocess.run([str(BIN / "mapletctl"), "simulate", source, "--out", self.file("truth")],
                       check=True, capture_output=True)
        self.truth = tum(self.file("truth/groundtruth.txt"))

    def finish(self, daemon):
        _, wrong = daemon.communicate(timeout=PATIENCE_S)
        self.assertEqual(daemon.returncode, 0, wrong)

    def leave(self, node):
        child, said, reader = node
        child.terminate()
        child.wait()
        reader.join()
        return said

    def test_a_node_sees_what_the_daemon_knows(self):
        early = self.node(PATIENCE_S)
        daemon = self.daemon(ROOM, "ros2.enabled=true", "ros2.path_hz=5")
        time.sleep(4.0)
        late = self.node(PATIENCE_S)
        self.finish(daemon)
        time.sleep(0.5)
        said = self.leave(early)
        by_kind = {kind: [m for m in said if m["kind"] == kind]
                   for kind in ("odometry", "tf", "path", "markers", "diagnostics")}
        self.check_odometry(by_kind["odometry"])
        self.check_tf(by_kind["tf"], by_kind["odometry"])
        self.check_path(by_kind["path"])
        self.check_map(by_kind["markers"])
        self.check_map([m for m in self.leave(late) if m["kind"] == "markers"])
        self.check_diagnostics(by_kind["diagnostics"])

    def check_up(self, m):
        """z of odom is up: as far from the body's as in truth, to a degree."""
        camera = self.truth[round(m["stamp"], 6)]
        body = composed(camera, inverse(BODY_CAMERA))
        up = [turned(inverse(p)[3:], (0, 0, 1)) for p in (body, m["pose"])]
        self.assertGreater(sum(a * b for a, b in zip(*up)), math.cos(0.02))

    def check_odometry(self, odometry):
        self.simulate(ROOM)
        inside = tum(self.file("run/odometry.tum"))
        self.assertGreater(len(odometry), len(inside) // 3)
        first = None
        for m in odometry:
            self.assertEqual((m["frame"], m["child"]), ("odom", "base_link"))
            camera = inside[round(m["stamp"], 6)]
            if first is None:
                first = (m["pose"], camera)
                self.check_up(m)
            moved = composed(composed(BODY_CAMERA, composed(inverse(first[1]), camera)),
                             inverse(BODY_CAMERA))
            told = composed(inverse(first[0]), m["pose"])
            self.assertLess(math.dist(told[:3], moved[:3]), 1e-6)
            self.assertLess(angle(told, moved), 1e-4)
            self.assertLess(abs(m["pose"][2]), 0.1)
            c = m["covariance"]
            for i in range(6):
                self.assertGreaterEqual(c[7 * i], 0.0)
                for j in range(6):
                    self.assertAlmostEqual(c[6 * i + j], c[6 * j + i], delta=1e-12)
        # The truth is within what it claims: four standard deviations of the way.
        truth = self.truth
        last = odometry[-1]
        true_way = composed(composed(BODY_CAMERA, composed(
            inverse(truth[round(odometry[0]["stamp"], 6)]), truth[round(last["stamp"], 6)])),
            inverse(BODY_CAMERA))
        told_way = composed(inverse(odometry[0]["pose"]), last["pose"])
        off = math.dist(true_way[:3], told_way[:3])
        sigma = math.sqrt(sum(last["covariance"][7 * i] for i in range(3)))
        self.assertLess(off, 4 * sigma)
        self.assertLess(sigma, 0.3)
        speeds = [math.hypot(*m["twist"][:3]) for m in odometry if m["twist_covariance"][0] < 1e5]
        self.assertGreater(len(speeds), len(odometry) // 2)
        self.assertAlmostEqual(sorted(speeds)[len(speeds) // 2], 0.5, delta=0.2)

    def check_tf(self, tf, odometry):
        poses = {round(m["stamp"], 6): m["pose"] for m in odometry}
        self.assertGreater(len(tf), 50)
        both = 0
        for m in tf:
            names = [(t["frame"], t["child"]) for t in m["transforms"]]
            self.assertEqual(names, [("map", "odom"), ("odom", "base_link")])
            pose = poses.get(round(m["transforms"][1]["stamp"], 6))
            if pose is None:
                continue
            both += 1
            self.assertLess(math.dist(m["transforms"][1]["T"][:3], pose[:3]), 1e-8)
            # As odometry and map have the same floor, they differ by a turn about z and a bit.
            self.assertGreater(turned(m["transforms"][0]["T"][3:], (0, 0, 1))[2], 0.999)
        self.assertGreater(both, 50)

    def check_path(self, paths):
        self.assertGreater(len(paths), 2)
        last = paths[-1]
        trajectory = tum(self.file("run/trajectory.tum"))
        poses = [p for p in last["poses"] if round(p["stamp"], 6) in trajectory]
        self.assertEqual(last["frame"], "map")
        self.assertGreater(len(poses), 20)
        a = poses[0]
        worst = 0.0
        for b in poses[1:]:
            self.assertGreater(b["stamp"], a["stamp"])
            moved = composed(composed(BODY_CAMERA, composed(
                inverse(trajectory[round(a["stamp"], 6)]), trajectory[round(b["stamp"], 6)])),
                inverse(BODY_CAMERA))
            told = composed(inverse(a["pose"]), b["pose"])
            worst = max(worst, math.dist(told[:3], moved[:3]))
        self.assertLess(worst, 0.03)

    def check_map(self, messages):
        report = json.loads(Path(self.file("run/report.json")).read_text(encoding="utf-8"))
        self.assertGreater(report["maplets"]["count"], 1)
        markers = {}
        for message in messages:
            for marker in message["markers"]:
                self.assertEqual((marker["frame"], marker["type"], marker["action"]),
                                 ("map", 11, 0))
                self.assertTrue(marker["ns"].startswith("agent_1_"))
                self.assertGreater(marker["alpha"], 0.1)
                markers[marker["id"]] = marker
        self.assertEqual(sorted(markers), list(range(report["maplets"]["count"])))
        poses = {}
        for line in Path(self.file("run/skeleton.g2o")).read_text(encoding="utf-8").splitlines():
            words = line.split()
            if words[0] == "VERTEX_SE3:QUAT":
                poses[int(words[1])] = tuple(map(float, words[2:9]))
        floor = []
        for number, marker in markers.items():
            shown = subprocess.run(
                [str(BIN / "mapletctl"), "show", "--json",
                 self.file(f"run/maplets/{number:04}.maplet")],
                check=True, capture_output=True, text=True).stdout
            planes = json.loads(shown)["planes"]
            self.assertEqual(len(marker["points"]) % 6, 0)
            whole = sum(plane["area_m2"] for plane in planes)
            share = area(marker["points"]) / whole  # small pieces are left out
            self.assertTrue(0.8 < share < 1.001, share)
            for point in marker["points"]:  # in the maplet's frame, on one of its planes
                self.assertLess(min(abs(sum(p * n for p, n in zip(point, plane["n"])) + plane["d"])
                                    for plane in planes), 1e-3)
            way = composed(inverse(poses[0]), poses[number])
            told = composed(inverse(markers[0]["pose"]), marker["pose"])
            self.assertLess(math.dist(way[:3], told[:3]), 5e-3)
            floor += [composed(marker["pose"], (*p, 0, 0, 0, 1))[2] for p in marker["points"]]
        self.assertLess(min(floor), -0.5)  # the floor is below the body

    def check_diagnostics(self, diagnostics):
        report = json.loads(Path(self.file("run/report.json")).read_text(encoding="utf-8"))
        self.assertGreater(len(diagnostics), 3)
        levels = {m["message"]: m["level"] for m in diagnostics}
        self.assertEqual(levels.get("tracking"), 0, levels)
        running = [m for m in diagnostics if m["values"]["state"] == "running"][-1]
        self.assertEqual(running["name"], "mapletd: agent 1")
        self.assertEqual(running["hardware"], "mapletd-1")
        processed = int(running["values"]["frames_processed"])
        self.assertTrue(0 < processed <= report["frames"]["processed"])

    # --- external odometry ---

    def truth_of_corridor(self):
        self.simulate(CORRIDOR)
        return self.truth

    def write_odometry(self, truth, spoil=None):
        """What a base would say, in a frame of its own, two per cent too long."""
        begin = next(iter(truth.values()))
        lines = []
        for i, (stamp, camera) in enumerate(truth.items()):
            way = composed(composed(BODY_CAMERA, composed(inverse(begin), camera)),
                           inverse(BODY_CAMERA))
            way = (*(1.02 * v for v in way[:3]), *way[3:])
            line = [stamp, stamp, "wheel_odom", "base_link", *way, 0.0, 1]
            lines += spoil(i, line) if spoil else [line]
        Path(self.file("wheels")).write_text(
            "".join(" ".join(map(str, line)) + "\n" for line in lines), encoding="utf-8")

    def corridor_run(self, *settings, out):
        node = self.node(PATIENCE_S, self.file("wheels"), "rt/wheel/odometry")
        time.sleep(0.5)
        daemon = self.daemon(CORRIDOR, "ros2.enabled=true", *settings, out=out)
        status = {}
        while daemon.poll() is None:
            asked = subprocess.run([str(BIN / "mapletctl"), "status", "--json", "--socket",
                                    self.file("socket")], check=False, capture_output=True,
                                   text=True)
            if asked.returncode == 0:
                status = json.loads(asked.stdout)
            time.sleep(0.3)
        self.finish(daemon)
        self.leave(node)
        return status

    def share_of_the_way(self, truth, out):
        """How far the track came, of how far the camera went."""
        track = tum(self.file(f"{out}/odometry.tum"))
        stamps = [s for s in track if s in truth and s > 2.0]  # the two have found each other
        a, b = stamps[0], stamps[-1]
        went = math.dist(truth[a][:3], truth[b][:3])
        self.assertGreater(went, 1.2)
        return math.dist(track[a][:3], track[b][:3]) / went

    def test_odometry_of_others_carries_the_track_along_a_corridor(self):
        truth = self.truth_of_corridor()
        self.write_odometry(truth)
        self.corridor_run(out="alone")
        self.assertLess(self.share_of_the_way(truth, "alone"), 0.5)
        status = self.corridor_run("ros2.external_odometry=wheel/odometry",
                                   f"recorder.file={self.file('flight')}", out="led")
        self.assertAlmostEqual(self.share_of_the_way(truth, "led"), 1.02, delta=0.08)
        external = status["external_odometry"]
        self.assertEqual(external["publishers"], 1)
        self.assertGreater(external["used"], 50)
        report = json.loads(Path(self.file("led/report.json")).read_text(encoding="utf-8"))
        self.assertGreater(report["tracking"]["hints_used"], 50)
        if "MAPLET_SANITIZED" not in os.environ:
            self.assertEqual(report["memory"]["heap_allocations_after_ready"], 0)
        # The recorder has what others said, too: it runs again as it ran.
        subprocess.run([str(BIN / "mapletd"), "--source", "record:" + self.file("flight"), "--out",
                        self.file("again")], check=True, capture_output=True, timeout=PATIENCE_S)
        same = subprocess.run([str(BIN / "mapletctl"), "diff", self.file("led"),
                               self.file("again")], check=False, capture_output=True, text=True)
        self.assertEqual(same.returncode, 0, same.stdout)

    def test_a_publisher_gone_mad_is_refused_and_counted(self):
        truth = self.truth_of_corridor()

        def spoil(i, line):
            release, stamp, frame, child, x, y, z, *q, sigma, copies = line
            lines = [line]

            def add(**change):
                v = dict(stamp=stamp, frame=frame, child=child, x=x, q=q, copies=1) | change
                lines.append([release, v["stamp"], v["frame"], v["child"], v["x"], y, z, *v["q"],
                              sigma, v["copies"]])
            if i % 10 == 3:
                add(x=math.nan)
                add(q=[0, 0, 0, 3])
                add(q=[0, 0, 0, 0])
                add(frame="elsewhere")
                add(child="base_footprint")
                add(child="-")
                add(stamp=stamp + 1.7e9)
                add(stamp=stamp - 0.4)
                add(stamp=stamp + 0.005, x=x + 40.0)
                add(copies=300)
            return lines
        self.write_odometry(truth, spoil)
        status = self.corridor_run("ros2.external_odometry=wheel/odometry", out="mad")
        external = status["external_odometry"]
        for kind in ("malformed", "wrong_frame", "other_clock", "backwards", "leapt"):
            self.assertGreater(external[kind], 5, external)
        self.assertGreater(external["backwards"] + external["flooded"], 100, external)
        self.assertAlmostEqual(self.share_of_the_way(truth, "mad"), 1.02, delta=0.1)

    def test_a_topic_that_nobody_writes_holds_nothing_up(self):
        self.write_odometry(self.truth_of_corridor())
        status = self.corridor_run("ros2.external_odometry=no_such/odometry", out="none")
        self.assertEqual(status["external_odometry"]["publishers"], 0)
        self.assertEqual(status["external_odometry"]["received"], 0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
