#!/usr/bin/env python3
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""The same mission on this processor and, by qemu-user, on ARM: how far the poses are apart.

    arm_agreement.py HOST_BUILD ARM_BUILD... [--source URI]

Both trajectories begin at the first frame, so they are compared as they are; no budget cuts a frame, as
emulation takes tens of times longer. Fails beyond 1 mm or 0.01 degrees rms. The whole loop takes about ten minutes.
"""
import argparse
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path

MOST_M, MOST_DEG = 0.001, 0.01
TRAJECTORIES = ("odometry.tum", "trajectory.tum")


def emulator(build):
    """Words before the program: what CMake was told when the build was configured."""
    for line in (build / "CMakeCache.txt").read_text().splitlines():
        if line.startswith("MAPLET_EMULATOR:"):
            return [line.partition("=")[2], "-L", build.parent / "sysroot" / build.name]
    return []


def fly(build, source, out):
    words = emulator(build)
    environment = os.environ | ({"MAPLET_EMULATOR": " ".join(map(str, words))} if words else {})
    run = subprocess.run([*words, build / "bin/mapletd", "--source", source, "--no-dds", "--out", out,
                          "--set", "frame.budget_us=1000000", "--set", "control.socket=none"],
                         stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=environment)
    if run.returncode != 0:
        sys.exit(f"FAIL  {build}: mapletd ended with {run.returncode}:\n{run.stderr}")


def poses(file):
    lines = (line.split() for line in file.read_text().splitlines() if not line.startswith("#"))
    return {words[0]: [float(word) for word in words[1:8]] for words in lines}


def turn_rad(a, b):
    sign = 1 if sum(x * y for x, y in zip(a, b)) >= 0 else -1
    return 4 * math.asin(min(1, math.dist(a, [sign * x for x in b]) / 2))


def rms(values):
    return math.sqrt(sum(v * v for v in values) / len(values))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("host", type=Path)
    parser.add_argument("arm", type=Path, nargs="+")
    parser.add_argument("--source", default="sim:loop?seed=7&width=320")
    options = parser.parse_args()
    there = [build for build in options.arm if (build / "bin/mapletd").exists()]
    if not there:
        print("SKIPPED: no build for ARM (tools/build-arm)")
        return 77
    agree = True
    with tempfile.TemporaryDirectory(prefix="arm-agreement-") as work:
        work = Path(work)
        fly(options.host, options.source, work / "host")
        for build in there:
            fly(build, options.source, work / build.name)
            for name in TRAJECTORIES:
                here, arm = poses(work / "host" / name), poses(work / build.name / name)
                both = sorted(here.keys() & arm.keys())
                off_m = rms([math.dist(here[s][:3], arm[s][:3]) for s in both])
                off_deg = math.degrees(rms([turn_rad(here[s][3:], arm[s][3:]) for s in both]))
                good = off_m <= MOST_M and off_deg <= MOST_DEG and len(both) == len(here) == len(arm)
                agree &= good
                print(f"{'PASS' if good else 'FAIL'}  {build.name} {name}: {1000 * off_m:.4f} mm, {off_deg:.5f} deg rms, "
                      f"{len(both)} poses of {len(here)} and {len(arm)}", flush=True)
    return 0 if agree else 1


if __name__ == "__main__":
    sys.exit(main())
