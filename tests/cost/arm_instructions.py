#!/usr/bin/env python3
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""Instructions of a frame on an ARM processor beside this one's: what a board's clock has to carry.

    arm_instructions.py HOST_BUILD ARM_BUILD... [--frames N] [--source URI]... [--config FILE]

HOST_BUILD and ARM_BUILD as in build/release build/arm64. The frames are written to a folder once; here
valgrind counts, for ARM qemu-user's log of executed blocks is read (Debian's has no plugins): minutes.
Prints a Markdown table: mean and most of a frame. "process" is all that all threads do for a frame,
reading it from a PNG included.
"""
import argparse
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

STAGES = {"frame": "maplet::Agent::step(", "patches": "maplet::PatchExtractor::run(",
          "odometry": "maplet::Tracker::run("}
MANGLED = {b"_ZN6maplet5Agent4stepE": "frame", b"_ZN6maplet14PatchExtractor3runE": "patches",
           b"_ZN6maplet7Tracker3runE": "odometry"}
SOURCES = ("sim:loop?seed=7&width=160", "sim:loop?seed=7&width=320", "sim:loop?seed=7&width=640")
ELF_MACHINES = {0x28: "arm", 0xB7: "aarch64"}


class Counter:
    """Follows qemu's log (-d in_asm,exec,nochain): instructions between a function's entry and the
    return to the block after its call, a thread at a time."""

    def __init__(self):
        self.blocks = {}  # address: instructions, address after the last one
        self.entries = {}  # address: stage
        self.counts = {stage: [] for stage in STAGES}
        self.all = 0  # from the first frame on
        self.all_by_frame = [0]
        self.threads = {}  # number: address after its last block, {stage: [return address, count]}

    def translated(self, symbol, lines):
        first = int(lines[0].split(b":", 1)[0], 16)
        address, rest = lines[-1].split(b":", 1)
        code = re.match(rb"\s*((?:[0-9a-f]{2,8} ?)+)", rest).group(1).replace(b" ", b"")
        self.blocks[first] = (len(lines), int(address, 16) + len(code) // 2)
        for start, stage in MANGLED.items():
            if symbol.startswith(start) and stage not in self.entries.values():
                self.entries[first] = stage  # a function is entered at its first block

    def executed(self, thread, address):
        after, inside = self.threads.get(thread, (0, {}))
        size, end = self.blocks[address]
        for stage in [s for s, (back, _) in inside.items() if back == address]:
            self.counts[stage].append(inside.pop(stage)[1])
            if stage == "frame":
                self.all_by_frame.append(self.all)
        if address in self.entries:
            inside.setdefault(self.entries[address], [after, 0])
        for state in inside.values():
            state[1] += size
        if inside or self.all > 0:
            self.all += size
        self.threads[thread] = (end, inside)

    def read(self, log):
        symbol, lines = b"", []
        for line in log:
            if line.startswith(b"Trace "):
                words = line.split(None, 4)
                self.executed(words[1], int(line.split(b"/", 2)[1], 16))
            elif line.startswith(b"IN: "):
                symbol, lines = line[4:].strip(), []
            elif line.startswith(b"0x"):
                lines.append(line)
            elif lines:
                self.translated(symbol, lines)
                lines = []


def machine_of(program):
    with open(program, "rb") as file:
        number = int.from_bytes(file.read(20)[18:20], "little")
    return ELF_MACHINES.get(number) or sys.exit(f"arm_instructions: {program} is no ARM program")


def mission(build, folder, out, config):
    command = [build / "bin/mapletd", "--source", f"tum:{folder}", "--no-dds", "--out", out,
               "--set", "control.socket=none"]
    return command + (["--config", config] if config else [])


def arm_counts(build, folder, out, config):
    machine = machine_of(build / "bin/mapletd")
    sysroot = build.parent / "sysroot" / {"arm": "armhf", "aarch64": "arm64"}[machine]
    log = folder.parent / f"{build.name}.log"  # not stderr: that is the program's
    os.mkfifo(log)
    qemu = [f"qemu-{machine}-static", "-L", str(sysroot)]
    command = [*qemu, "-d", "in_asm,exec,nochain", "-D", log, *mission(build, folder, out, config)]
    counter = Counter()
    environment = os.environ | {"MAPLET_EMULATOR": " ".join(qemu)}  # for what draws the map
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, env=environment) as process, open(log, "rb") as lines:
        counter.read(lines)
    if process.returncode != 0:
        sys.exit(f"arm_instructions: {' '.join(map(str, command))} gave {process.returncode}")
    frames = counter.all_by_frame
    return {**counter.counts, "process": [b - a for a, b in zip(frames, frames[1:])]}


def host_counts(build, folder, out, config):
    """Callgrind writes a part for each call when told to dump after the function: in other words than
    it was told to count in, as it keeps one option a pattern."""
    counts = {}
    for stage, function in STAGES.items():
        parts = out / f"callgrind-{stage}"
        parts.mkdir(parents=True)
        subprocess.run(["valgrind", "--tool=callgrind", f"--toggle-collect={function}*",
                        f"--dump-after=*{function}*", f"--callgrind-out-file={parts}/p",
                        *mission(build, folder, out / stage, config)], check=True, capture_output=True)
        totals = [int(re.search(r"^(?:totals|summary): (\d+)", part.read_text(), re.M).group(1))
                  for part in parts.glob("p.*")]
        counts[stage] = [total for total in totals if total > 0]
    return counts


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("host", type=Path)
    parser.add_argument("arm", type=Path, nargs="+")
    parser.add_argument("--frames", type=int, default=20)
    parser.add_argument("--source", action="append")
    parser.add_argument("--config", type=Path)
    options = parser.parse_args()
    print("| source | stage | build | frames | mean, M | most, M |\n|---|---|---|---|---|---|")
    for source in options.source or SOURCES:
        with tempfile.TemporaryDirectory(prefix="arm-instructions-") as work:
            work = Path(work)
            subprocess.run([options.host / "bin/mapletctl", "simulate", f"{source}&frames={options.frames}",
                            "--out", work / "frames"], check=True, capture_output=True)
            rows = [(options.host, host_counts(options.host, work / "frames", work / "host", options.config))]
            rows += [(arm, arm_counts(arm, work / "frames", work / arm.name, options.config)) for arm in options.arm]
        for stage in [*STAGES, "process"]:
            for build, counts in rows:
                each = counts.get(stage, [])
                if not each:
                    continue
                print(f"| `{source}` | {stage} | {build.name} | {len(each)} | "
                      f"{sum(each) / len(each) / 1e6:.2f} | {max(each) / 1e6:.2f} |", flush=True)


if __name__ == "__main__":
    main()
