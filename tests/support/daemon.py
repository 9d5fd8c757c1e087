# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""For tests that run mapletd as a service."""
import json
import os
import select
import socket
import subprocess
import tempfile
import threading
import time
import unittest
from pathlib import Path

BIN = Path(os.environ["MAPLET_BIN_DIR"])
PATIENCE_S = 180.0 if "MAPLET_SANITIZED" in os.environ else 60.0


def may_mount():
    """Whether a private mount is allowed here (a user namespace, or root)."""
    return subprocess.run(["unshare", "-Urm", "sh", "-c", "mount -t tmpfs none /mnt"], check=False,
                          capture_output=True).returncode == 0


class DaemonTest(unittest.TestCase):
    """mapletd as a process of its own, with a notify socket that stands in for systemd's."""

    def setUp(self):
        self.folder = tempfile.TemporaryDirectory(prefix="maplet-service-")
        self.notify = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.notify.bind(self.file("notify"))
        self.heard = []
        self.daemon = None

    def tearDown(self):
        if self.daemon is not None and self.daemon.poll() is None:
            self.daemon.kill()
        if self.daemon is not None:
            self.daemon.communicate()
        self.notify.close()
        self.folder.cleanup()

    def file(self, name):
        return os.path.join(self.folder.name, name)

    def config(self, text):
        Path(self.file("mapletd.toml")).write_text(text, encoding="utf-8")

    def start(self, *arguments, watchdog_s=0, before=None, environment=None, wrapper=()):
        env = dict(os.environ, NOTIFY_SOCKET=self.file("notify"), **(environment or {}))
        if watchdog_s:
            env["WATCHDOG_USEC"] = str(int(watchdog_s * 1e6))
        command = [*wrapper, str(BIN / "mapletd"), "--no-dds", "--set",
                   f"control.socket={self.file('socket')}", *arguments]
        if os.path.exists(self.file("mapletd.toml")):
            command += ["--config", self.file("mapletd.toml")]
        self.daemon = subprocess.Popen(command, env=env, stderr=subprocess.PIPE, text=True,
                                       preexec_fn=before)

    def listen(self):
        """Waits a little for a word, and takes what else there is: who is not heard waits."""
        patience_s = 0.2
        while select.select([self.notify], [], [], patience_s)[0]:
            self.heard += self.notify.recv(4096).decode().split("\n")
            patience_s = 0

    def until(self, condition, patience_s=PATIENCE_S):
        end = time.monotonic() + patience_s
        while not condition():
            self.assertLess(time.monotonic(), end, f"did not happen in time; heard {self.heard}")
            self.listen()

    def count(self, word):
        return sum(line == word for line in self.heard)

    def ctl(self, *words):
        done = subprocess.run([str(BIN / "mapletctl"), *words, "--socket", self.file("socket")],
                              capture_output=True, text=True, timeout=PATIENCE_S)
        return done.returncode, done.stdout, done.stderr

    def stop(self):
        ended = threading.Event()

        def listen():  # whose words nobody takes waits for ever
            while not ended.is_set():
                self.listen()
        listener = threading.Thread(target=listen)
        listener.start()
        begin = time.monotonic()
        self.daemon.terminate()
        try:
            _, said = self.daemon.communicate(timeout=PATIENCE_S)
            took_s = time.monotonic() - begin
        finally:
            ended.set()
            listener.join()
        return self.daemon.returncode, took_s, said

    def notify_left(self):
        before = len(self.heard)
        self.listen()
        return len(self.heard) > before

    def ask(self, question):
        """One line to the daemon's socket, one from it: quicker than a process."""
        with socket.socket(socket.AF_UNIX) as link:
            link.settimeout(PATIENCE_S)
            link.connect(self.file("socket"))
            link.sendall((json.dumps(question) + "\n").encode())
            return json.loads(link.makefile().read())

    def status(self):
        code, said, wrong = self.ctl("status", "--json")
        self.assertEqual(code, 0, wrong)
        return json.loads(said)
