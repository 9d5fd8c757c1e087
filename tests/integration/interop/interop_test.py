#!/usr/bin/env python3
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
"""A Fast DDS subscriber gets the delta-poses that mapletd's publisher writes, late joiner or not."""
import json
import os
import random
import subprocess
import time
import unittest
from pathlib import Path

TESTS = Path(os.environ["MAPLET_BIN_DIR"]).parent / "tests"
COUNT = 40


class Interop(unittest.TestCase):
    def check(self, subscriber_first):
        domain = str(random.randrange(20, 220))
        listen = [str(TESTS / "fastdds_subscriber"), domain, str(COUNT), "60"]
        publish = [str(TESTS / "dds_publish"), domain, "3", str(COUNT), "8000"]
        first, second = (listen, publish) if subscriber_first else (publish, listen)
        one = subprocess.Popen(first, stdout=subprocess.PIPE, text=True)
        time.sleep(1.0)
        two = subprocess.Popen(second, stdout=subprocess.PIPE, text=True)
        outs = {first[0]: one.communicate(timeout=90)[0], second[0]: two.communicate(timeout=90)[0]}
        self.assertEqual((one.returncode, two.returncode), (0, 0))
        sent = [json.loads(line) for line in outs[publish[0]].splitlines()]
        got = [line.split() for line in outs[listen[0]].splitlines()]
        self.assertEqual(len(got), COUNT)
        for record, words in zip(sent, got):
            self.assertEqual(words[:4], [str(record["agent"]), str(record["epoch"]), "0",
                                         str(record["seq"])])
            self.assertEqual(words[4], f"{record['a']['agent']}:{record['a']['id']}")
            self.assertEqual(words[5], f"{record['b']['agent']}:{record['b']['id']}")
            self.assertAlmostEqual(int(words[6]) / 1e9, record["stamp_a_s"], places=5)
            for word, truth in zip(words[8:11], record["T_a_b"][:3]):
                self.assertAlmostEqual(float(word), truth, places=6)
            for i in range(6):  # the standard deviations are the covariance's diagonal
                self.assertAlmostEqual(float(words[11 + i]) ** 2 / record["covariance"][7 * i], 1.0,
                                       delta=0.02)
            self.assertEqual(words[-1], str(record["matches"]))

    def test_subscriber_first(self):
        self.check(True)

    def test_late_subscriber(self):
        self.check(False)


if __name__ == "__main__":
    unittest.main(verbosity=2)
