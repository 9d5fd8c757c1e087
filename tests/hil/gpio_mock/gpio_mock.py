# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""The test's side of the GPIO chip that gpio_mock.cpp shows to a program."""
import mmap
import os
import struct
import time

LINES, RING = 8, 4096
LINE_BYTES, CHANGE_BYTES = 72, 16
AT_LINES = 16
AT_IN = AT_LINES + LINES * LINE_BYTES
AT_OUT = AT_IN + RING * CHANGE_BYTES
BYTES = AT_OUT + RING * CHANGE_BYTES

# What umockdev shows: the node and its place in sysfs.
DEVICE = """P: /devices/platform/maplet-mock/gpiochip0
N: gpiochip0
E: DEVNAME=/dev/gpiochip0
E: SUBSYSTEM=gpio
E: MAJOR=254
E: MINOR=0
A: dev=254:0\\n

"""


class Chip:
    def __init__(self, folder, names, taken=()):
        self.file = os.path.join(folder, "gpio")
        self.device = os.path.join(folder, "gpio.umockdev")
        with open(self.device, "w", encoding="ascii") as device:
            device.write(DEVICE)
        with open(self.file, "wb") as content:
            content.truncate(BYTES)
        with open(self.file, "r+b") as content:
            self.memory = mmap.mmap(content.fileno(), BYTES)
        self.names = list(names)
        for i, name in enumerate(self.names):
            user = b"somebody" if name in taken else b""
            struct.pack_into("32s32s", self.memory, AT_LINES + i * LINE_BYTES, name.encode(), user)

    def environment(self, library):
        return {"MAPLET_GPIO_MOCK": self.file, "LD_PRELOAD": library}

    def wrapper(self):
        return ["umockdev-run", "--device", self.device, "--"]

    def level(self, name):
        return self.memory[AT_LINES + self.names.index(name) * LINE_BYTES + 64]

    def taken(self, name):
        return self.memory[AT_LINES + self.names.index(name) * LINE_BYTES + 32] != 0

    def start_level(self, name, level):
        self.memory[AT_LINES + self.names.index(name) * LINE_BYTES + 64] = level

    def drive(self, name, level, at_s=None):
        """The line changes now; the kernel's stamp may be told."""
        count = struct.unpack_from("I", self.memory, 4)[0]
        at_ns = int(1e9 * (time.monotonic() if at_s is None else at_s))
        struct.pack_into("QII", self.memory, AT_IN + count % RING * CHANGE_BYTES, at_ns,
                         self.names.index(name), level)
        struct.pack_into("I", self.memory, 4, count + 1)

    def driven(self, name):
        """What the program did to an output: (time in s, level) each."""
        count = min(struct.unpack_from("I", self.memory, 8)[0], RING)
        changes = [struct.unpack_from("QII", self.memory, AT_OUT + i * CHANGE_BYTES)
                   for i in range(count)]
        line = self.names.index(name)
        return [(at / 1e9, level) for at, number, level in changes if number == line]

    def pull_out(self):
        struct.pack_into("I", self.memory, 0, 1)
