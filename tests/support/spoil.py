# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""Faults for recordings in TUM layout."""
import os
import struct
import zlib
from pathlib import Path


def black_png(path, width, height):
    """A depth image without any depth."""
    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))
    Path(path).write_bytes(
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 16, 0, 0, 0, 0))
        + chunk(b"IDAT", zlib.compress(bytes((2 * width + 1) * height))) + chunk(b"IEND", b""))


def spoil(folder, dice):
    """Faults in a recording: each of these at least once. @return how many"""
    listing = Path(folder, "depth.txt")
    lines = listing.read_text(encoding="utf-8").splitlines()
    images = [Path(folder, line.split()[1]) for line in lines if not line.startswith("#")]
    size = struct.unpack(">II", images[0].read_bytes()[16:24])
    kinds = {
        "missing": lambda p: p.unlink(),
        "cut short": lambda p: os.truncate(p, dice.randrange(p.stat().st_size)),
        "garbage": lambda p: p.write_bytes(dice.randbytes(500)),
        "black": lambda p: black_png(p, *size),
        "of another size": lambda p: black_png(p, size[0] // 2, size[1]),
    }
    faults = list(kinds) + dice.choices(list(kinds), k=dice.randrange(8))
    victims = dice.sample(range(3, len(images)), len(faults))
    for at, fault in zip(victims, faults):
        kinds[fault](images[at])
    at = dice.randrange(20, len(images) - 20)
    del lines[at:at + dice.randrange(1, 12)]      # a gap: frames that never came
    lines[-5], lines[-9] = lines[-9], lines[-5]   # two whose stamps go backwards
    listing.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return len(faults) + 2
