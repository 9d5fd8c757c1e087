#!/usr/bin/env python3
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""Pose records as an autopilot's bridge gets them: the daemon's own odometry, in either axes; and
nobody being there holds nothing up."""
import math
import os
import socket
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import read_pose  # noqa: E402  the example is the test's reader

MAPLETD = str(Path(os.environ["MAPLET_BIN_DIR"]) / "mapletd")
EMULATOR = os.environ.get("MAPLET_EMULATOR", "").split()  # of programs for another processor
SOURCE = "sim:room?frames=60&width=160&gray=0&seed=4"
PATIENCE_S = 120 * int(os.environ.get("MAPLET_PATIENCE", "1"))


def quaternion_product(a, b):
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz)


def turned(q, v):
    x, y, z, _ = quaternion_product(quaternion_product(q, (*v, 0.0)), (-q[0], -q[1], -q[2], q[3]))
    return x, y, z


def composed(a, b):
    t = turned(a[3:], b[:3])
    return (*(a[i] + t[i] for i in range(3)), *quaternion_product(a[3:], b[3:]))


def inverse(a):
    q = (-a[3], -a[4], -a[5], a[6])
    t = turned(q, a[:3])
    return (-t[0], -t[1], -t[2], *q)


BODY_CAMERA = (0.1, 0.0, 0.2, -0.5, 0.5, -0.5, 0.5)
HALF_TURN = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)


class Autopilot(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory(prefix="maplet-autopilot-")
        self.out = os.path.join(self.folder.name, "run")

    def tearDown(self):
        self.folder.cleanup()

    def run_daemon(self, destination, *settings):
        words = [*EMULATOR, MAPLETD, "--no-dds", "--agent", "1", "--source", SOURCE, "--out", self.out,
                 "--set", f"autopilot.destination={destination}"]
        for setting in settings:
            words += ["--set", setting]
        return subprocess.run(words, capture_output=True, text=True, timeout=PATIENCE_S,
                              check=False)

    def odometry(self):
        lines = Path(self.out, "odometry.tum").read_text(encoding="utf-8").splitlines()
        return {round(float(line.split()[0]), 6): tuple(map(float, line.split()[1:]))
                for line in lines}

    def records_of(self, frame):
        link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        link.bind(("127.0.0.1", 0))
        link.settimeout(0.5)
        done = self.run_daemon(f"udp:127.0.0.1:{link.getsockname()[1]}", "autopilot.rate_hz=1000",
                               f"output_frame={frame}",
                               "body.T_body_camera=" + ",".join(map(str, BODY_CAMERA)))
        self.assertEqual(done.returncode, 0, done.stderr)
        records = []
        try:
            while True:
                record = read_pose.decode(link.recv(2048))
                self.assertIsNotNone(record)
                records.append(record)
        except TimeoutError:
            link.close()
        return records

    def check(self, frame):
        records = self.records_of(frame)
        odometry = self.odometry()
        self.assertGreater(len(records), 40)
        self.assertEqual([r["sequence"] for r in records],
                         list(range(records[0]["sequence"], records[0]["sequence"] + len(records))))
        compared = 0
        first = None
        for record in records:
            self.assertEqual((record["frame"], record["agent"], record["size"]), (frame, 1, 316))
            self.assertEqual(record["flags"] & read_pose.SYSTEM_CLOCK, 0)  # a recording's stamps
            if not record["flags"] & read_pose.TRACKING:
                continue
            inside = odometry[round(record["stamp_s"], 6)]
            outside = (*record["position"], *record["q_xyzw"])
            if first is None:
                first = (outside, inside)
                # At the origin, x where the body looks; level but for the camera's own tilt, of
                # which body.T_body_camera says nothing here.
                self.assertLess(math.dist(outside[:3], (0, 0, 0)), 1e-6)
                self.assertAlmostEqual(turned(outside[3:], (1, 0, 0))[1], 0.0, delta=1e-6)
                self.assertGreater(turned(outside[3:], (0, 0, 1))[2], 0.95)
                continue
            moved = composed(composed(BODY_CAMERA, composed(inverse(first[1]), inside)),
                             inverse(BODY_CAMERA))
            if frame == "ned_frd":
                moved = composed(composed(HALF_TURN, moved), HALF_TURN)
            told = composed(inverse(first[0]), outside)
            self.assertLess(math.dist(told[:3], moved[:3]), 1e-5)
            self.assertGreater(abs(sum(a * b for a, b in zip(told[3:], moved[3:]))), 1 - 1e-6)
            self.assert_honest(record)
            compared += 1
        self.assertGreater(compared, 40)
        return records

    def assert_honest(self, record):
        sigma = math.sqrt(max(record["covariance"][i][i] for i in range(3)))
        self.assertGreaterEqual(record["sigma_m"], sigma * 0.999)
        self.assertLess(record["sigma_m"], 2 * sigma)
        self.assertTrue(0.0 <= record["sigma_m"] < 0.2)
        if record["flags"] & read_pose.MOVES:
            self.assertLess(math.hypot(*record["twist"][:3]), 1.5)  # half a metre a second, noisy

    def test_enu_flu(self):
        self.check("enu_flu")

    def test_ned_frd_and_its_velocity(self):
        records = self.check("ned_frd")
        moving = [r for r in records if r["flags"] & read_pose.MOVES]
        a, b = moving[10], moving[30]
        dt = b["stamp_s"] - a["stamp_s"]
        way = [(q - p) / dt for p, q in zip(a["position"], b["position"])]
        mean = [0.0, 0.0, 0.0]
        for r in moving[11:31]:
            for i, v in enumerate(turned(r["q_xyzw"], r["twist"][:3])):
                mean[i] += v / 20
        self.assertLess(math.dist(way, mean), 0.1)

    def test_nobody_there(self):
        """A path that is none, a port that nobody listens at: the run is as long, and as good."""
        begin = time.monotonic()
        self.assertEqual(self.run_daemon("unix:/nowhere/at/all").returncode, 0)
        unix_s = time.monotonic() - begin
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
            taken.bind(("127.0.0.1", 0))
            port = taken.getsockname()[1]
        self.assertEqual(self.run_daemon(f"udp:127.0.0.1:{port}").returncode, 0)
        self.assertLess(unix_s, PATIENCE_S / 2)
        self.assertGreater(len(self.odometry()), 40)

    def test_a_reader_that_does_not_read(self):
        path = os.path.join(self.folder.name, "pose")
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as link:
            link.bind(path)
            done = self.run_daemon(f"unix:{path}", "autopilot.rate_hz=1000")
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIsNotNone(read_pose.decode(link.recv(2048)))

    def test_rate(self):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
            link.bind(("127.0.0.1", 0))
            link.settimeout(0.2)
            begin = time.monotonic()
            done = self.run_daemon(f"udp:127.0.0.1:{link.getsockname()[1]}", "autopilot.rate_hz=2")
            took_s = time.monotonic() - begin
            self.assertEqual(done.returncode, 0)
            count = 0
            try:
                while link.recv(2048):
                    count += 1
            except TimeoutError:
                pass
        self.assertLessEqual(count, 2 * took_s + 2)
        self.assertGreaterEqual(count, 1)

    def test_what_makes_no_sense_is_refused(self):
        for setting in ("autopilot.destination=tcp:127.0.0.1:5", "autopilot.destination=udp:host:5",
                        "autopilot.destination=udp:127.0.0.1:99999", "autopilot.rate_hz=0",
                        "output_frame=enu", "body.T_body_camera=0,0,0,0,0,0,2"):
            done = subprocess.run([*EMULATOR, MAPLETD, "--check-config", "--set", setting], check=False,
                                  capture_output=True, text=True, timeout=PATIENCE_S)
            self.assertEqual(done.returncode, 2, setting)
            self.assertEqual(done.stderr.count("\n"), 1, done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
