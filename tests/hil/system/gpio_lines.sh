#!/bin/bash
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
# In the machine of qemu_test.sh: a chip of the GPIO simulator with four named lines.
set -e
chip=/sys/kernel/config/gpio-sim/robot
mkdir -p $chip/bank/line{0,1,2,3}
echo 8 >$chip/bank/num_lines
echo TRACKING >$chip/bank/line0/name
echo HEARTBEAT >$chip/bank/line1/name
echo HOLD >$chip/bank/line2/name
echo PPS >$chip/bank/line3/name
echo 1 >$chip/live
udevadm settle
