#!/usr/bin/env python3
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""Reads mapletd's pose records (docs/output.md, section "Autopilot") and prints a line for each.

    read_pose.py udp:ADDRESS:PORT | unix:PATH     what autopilot.destination says
"""
import math
import os
import socket
import struct
import sys

LAYOUT = struct.Struct("<4s4B2HIqI2fI3d4f6f21f21f3d4f")  # and the checksum behind it
FRAMES = ("enu_flu", "ned_frd", "camera")
TRACKING, PARTLY_FREE, MOVES, SYSTEM_CLOCK = 1, 2, 4, 8


def crc32c(data):
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x82F63B78 if crc & 1 else 0)
    return crc ^ 0xFFFFFFFF


def matrix(upper):
    """Six rows of what stands on and above the diagonal."""
    rows = [[0.0] * 6 for _ in range(6)]
    values = iter(upper)
    for i in range(6):
        for j in range(i, 6):
            rows[i][j] = rows[j][i] = next(values)
    return rows


def decode(data):
    """A record as a dictionary; None when it is none, or of a version that is not known here."""
    if len(data) != LAYOUT.size + 4 or data[:4] != b"MLPO" or data[4] != 1:
        return None
    if struct.unpack("<I", data[-4:])[0] != crc32c(data[:-4]):
        return None
    v = LAYOUT.unpack(data[:-4])
    return {"frame": FRAMES[v[2]], "flags": v[3], "reset_counter": v[4], "size": v[5],
            "agent": v[6], "sequence": v[7], "stamp_s": v[8] / 1e9, "age_us": v[9],
            "sigma_m": v[10], "sigma_rad": v[11], "map_jumps": v[12],
            "position": v[13:16], "q_xyzw": v[16:20], "twist": v[20:26],
            "covariance": matrix(v[26:47]), "twist_covariance": matrix(v[47:68]),
            "T_map_odom": v[68:75]}


def listen(destination):
    kind, _, where = destination.partition(":")
    if kind == "unix":
        link = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        if os.path.exists(where):
            os.unlink(where)
        link.bind(where)
        return link
    host, _, port = where.rpartition(":")
    family = socket.AF_INET6 if host.startswith("[") else socket.AF_INET
    link = socket.socket(family, socket.SOCK_DGRAM)
    link.bind((host.strip("[]"), int(port)))
    return link


def main():
    if len(sys.argv) != 2 or sys.argv[1] in ("-h", "--help"):
        sys.exit(__doc__)
    link = listen(sys.argv[1])
    while True:
        record = decode(link.recv(2048))
        if record is None:
            print("no pose record, or a damaged one", file=sys.stderr)
        elif not record["flags"] & TRACKING or math.isinf(record["sigma_m"]):
            print(f"{record['stamp_s']:.3f} lost")
        else:
            x, y, z = record["position"]
            print(f"{record['stamp_s']:.3f} {x:.3f} {y:.3f} {z:.3f} m, worst axis "
                  f"{record['sigma_m']:.3f} m, reset {record['reset_counter']}", flush=True)


if __name__ == "__main__":
    main()
