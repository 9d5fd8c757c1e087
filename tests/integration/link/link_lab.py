#!/usr/bin/env python3
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""A radio channel on a desk: network namespaces joined by a hub in user space.

Each namespace has one TAP interface, rad0, address 10.77.0.N/24. What it sends occupies one shared
half-duplex channel of a given rate, waits in one queue, is delayed, and reaches each other namespace
with its own luck: loss, bursts of loss, cuts. The hub notes every IP byte that is offered, when and
by whom. Needs root. Nothing outside the namespaces is touched.
"""
import collections
import ctypes
import fcntl
import heapq
import itertools
import os
import random
import select
import struct
import subprocess
import threading
import time

TUNSETIFF = 0x400454CA
IFF_TAP, IFF_NO_PI = 0x0002, 0x1000
CLONE_NEWNET = 0x40000000
LIBC = ctypes.CDLL(None, use_errno=True)


def possible():
    """Whether this machine lets us make namespaces and TAP interfaces."""
    if os.geteuid() != 0 or not os.path.exists("/dev/net/tun"):
        return False
    name = f"ml{os.getpid()}-try"
    made = subprocess.run(["ip", "netns", "add", name], capture_output=True)
    subprocess.run(["ip", "netns", "del", name], capture_output=True)
    return made.returncode == 0


def enter(fd):
    if LIBC.setns(fd, CLONE_NEWNET) != 0:
        raise OSError(ctypes.get_errno(), "setns")


class Namespace:
    def __init__(self, number):
        self.number = number
        self.name = f"ml{os.getpid()}-{number}"
        self.address = f"10.77.0.{number}"
        self.tap = None
        subprocess.run(["ip", "netns", "add", self.name], check=True)
        self.ip("link", "set", "lo", "up")

    def ip(self, *words):
        subprocess.run(["ip", "-n", self.name, *words], check=True)

    def command(self, *words):
        return ["ip", "netns", "exec", self.name, *words]

    def plug(self):
        """The interface appears."""
        home = os.open("/proc/self/ns/net", os.O_RDONLY)
        there = os.open(f"/run/netns/{self.name}", os.O_RDONLY)
        try:
            enter(there)
            tap = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
            fcntl.ioctl(tap, TUNSETIFF, struct.pack("16sH22x", b"rad0", IFF_TAP | IFF_NO_PI))
        finally:
            enter(home)
            os.close(home)
            os.close(there)
        self.ip("link", "set", "rad0", "address", f"02:00:00:00:00:{self.number:02x}")
        self.ip("addr", "add", f"{self.address}/24", "dev", "rad0")
        self.ip("link", "set", "rad0", "up")
        self.ip("route", "add", "224.0.0.0/4", "dev", "rad0")
        self.tap = tap

    def unplug(self):
        """The interface is gone."""
        tap, self.tap = self.tap, None
        if tap is not None:
            os.close(tap)

    def rename(self, old, new):
        self.ip("link", "set", old, "down")
        self.ip("link", "set", old, "name", new)
        self.ip("link", "set", new, "up")

    def close(self):
        self.unplug()
        subprocess.run(["ip", "netns", "del", self.name], check=False)


class Hub(threading.Thread):
    """Carries frames between namespaces until closed."""

    def __init__(self, namespaces, rate_bit_s, loss=0.0, burst=0.0, delay_s=0.2, queue_bytes=32000,
                 seed=1):
        super().__init__(daemon=True)
        self.namespaces = namespaces
        self.rate, self.loss, self.burst = rate_bit_s / 8.0, loss, burst
        self.delay_s, self.queue_bytes = delay_s, queue_bytes
        self.random = random.Random(seed)
        self.cut = set()  # pairs of numbers that do not hear each other
        self.offered = collections.defaultdict(list)  # number -> [(time, IP bytes)]
        self.dropped = 0
        self.done = False
        self.air = []
        self.order = itertools.count()  # two frames of one time keep theirs
        self.free_at = 0.0
        self.losing = collections.defaultdict(bool)
        self.start()

    def isolate(self, number):
        for other in self.namespaces:
            self.cut = self.cut | {(number, other.number), (other.number, number)}

    def isolate_all(self):
        for namespace in self.namespaces:
            self.isolate(namespace.number)

    def connect(self, one, other):
        self.cut = self.cut - {(one, other), (other, one)}

    def join_all(self):
        self.cut = set()

    def lost(self, receiver):
        chance = self.burst if self.losing[receiver] and self.burst else self.loss
        self.losing[receiver] = self.random.random() < chance
        return self.losing[receiver]

    def carry(self, sender, frame, now):
        if len(frame) < 34 or frame[12:14] not in (b"\x08\x00", b"\x08\x06"):
            return  # IPv4 and ARP only
        size = 28
        if frame[12:14] == b"\x08\x00":
            size = struct.unpack("!H", frame[16:18])[0]
            self.offered[sender.number].append((now, size))
        if max(self.free_at - now, 0.0) * self.rate > self.queue_bytes:
            self.dropped += 1
            return
        self.free_at = max(self.free_at, now) + size / self.rate
        for other in self.namespaces:
            if other is sender or (sender.number, other.number) in self.cut:
                continue
            if not frame[0] & 1 and frame[5] != other.number:
                continue  # for somebody else
            if self.lost(other.number):
                continue
            heapq.heappush(self.air, (self.free_at + self.delay_s, next(self.order), other, frame))

    def run(self):
        while not self.done:
            taps = {n.tap: n for n in self.namespaces if n.tap is not None}
            wait = 0.02
            if self.air:
                wait = min(wait, max(0.0, self.air[0][0] - time.monotonic()))
            try:
                ready = select.select(list(taps), [], [], wait)[0]
            except (OSError, ValueError):
                continue  # unplugged in between
            now = time.monotonic()
            for tap in ready:
                try:
                    self.carry(taps[tap], os.read(tap, 2048), now)
                except OSError:
                    pass
            while self.air and self.air[0][0] <= now:
                _, _, other, frame = heapq.heappop(self.air)
                try:
                    if other.tap is not None:
                        os.write(other.tap, frame)
                except OSError:
                    pass

    def bytes_between(self, number, start, end):
        return sum(size for at, size in list(self.offered[number]) if start <= at < end)

    def worst_window(self, number, start, end, window_s=10.0):
        """Most IP bytes that one sender offered within any window."""
        sent = [(at, size) for at, size in list(self.offered[number]) if start <= at < end]
        worst = total = first = 0
        for at, size in sent:
            total += size
            while sent[first][0] <= at - window_s:
                total -= sent[first][1]
                first += 1
            worst = max(worst, total)
        return worst

    def close(self):
        self.done = True
        self.join()


class Lab:
    """Namespaces 1..count, plugged in, and a hub."""

    def __init__(self, count, **channel):
        self.namespaces = []
        try:
            for number in range(1, count + 1):
                self.namespaces.append(Namespace(number))
                self.namespaces[-1].plug()
        except Exception:
            for namespace in self.namespaces:
                namespace.close()
            raise
        self.hub = Hub(self.namespaces, **channel)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.hub.close()
        for namespace in self.namespaces:
            namespace.close()
