#!/bin/bash
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
# Inside the machine of qemu_test.sh: GPIO lines of gpio-sim, gray images of vimc, a clock that was never
# set. Its time is its own (qemu_test.sh): what runs beside it does not matter.
. "$(dirname "$0")/claims.sh"

soon 200 systemctl -q is-active mapletd
held=$?
claim $held "enabled, it is ready after boot, in $(date +%Y)"
systemctl -q is-active mapletd || give_up
soon 200 running
held=$?
claim $held "it tracks the camera: $(show StatusText)"

# The simulator's bench: what a line carries, and what pulls at it.
bench=$(echo /sys/devices/platform/gpio-sim.*/gpiochip*)
level() { cat "$bench/sim_gpio$1/value"; }
stands() { [[ $(level "$1") = "$2" ]]; } # LINE LEVEL
changed() { ! stands "$1" "$2"; }
pull() { echo "pull-$2" >"$bench/sim_gpio$1/pull"; }
[[ $(status | jq -c .gpio.problems) = "[]" ]]
held=$?
claim $held "it has its four lines $(status | jq -c .gpio.problems)"
changes=0 last=$(level 1) end=$((SECONDS + 20))
while [[ $SECONDS -lt $end && $changes -lt 8 ]]; do
  now=$(level 1)
  [[ $now = "$last" ]] || changes=$((changes + 1))
  last=$now
  sleep 0.05
done
[[ $changes -ge 8 ]]
held=$?
claim $held "the heartbeat is on the line: $changes changes"
soon 60 stands 0 1
held=$?
claim $held "so is tracking"
pull 2 up
soon 60 bash -c '[[ $(mapletctl status --json | jq -r .state) = held ]]'
held=$?
claim $held "the hold switch holds it"
pull 2 down
soon 60 running
held=$?
claim $held "and lets it go"
for ((i = 0; i < 4; i++)); do
  pull 3 up
  sleep 0.2
  pull 3 down
  sleep 0.8
done
[[ $(status | jq '.gpio.pulse.pulses + .gpio.pulse.glitches') -ge 4 ]] # whether they lock is hil_gpio's matter
held=$?
claim $held "edges are seen: $(status | jq -c .gpio.pulse)"

soon 120 bash -c '[[ $(mapletctl status --json | jq .gray_camera.paired) -ge 3 ]]'
held=$?
claim $held "vimc's images are paired: $(status | jq -c .gray_camera)"

# The clock: set late, and back again.
restarts=$(show NRestarts)
held=0
for time in 2031-05-01 1999-12-31 2031-05-01; do
  date -s "$time" >/dev/null
  frames=$(status | jq .frames.processed)
  soon 60 bash -c "[[ \$(mapletctl status --json | jq .frames.processed) -ge $((frames + 5)) ]]" || held=1
done
claim $held "it does not mind the clock's leaps"
soon 60 running && [[ $(show NRestarts) = "$restarts" ]]
held=$?
claim $held "and goes on: $(show NRestarts) restarts, $(show StatusText)"

soon 400 safe 1
held=$?
claim $held "a maplet is on the disk"
mapped=$(status | jq '.journal.flushed.maplets // 0')
before=$(show MainPID)
hang_estimator "$before"
soon 200 restarted "$before"
held=$?
claim $held "a hung estimator is killed by the watchdog and comes back"
last=$(level 1)
soon 100 changed 1 "$last"
held=$?
claim $held "so does the heartbeat"
soon 200 running
held=$?
claim $held "it tracks again"
mapped "$mapped"
held=$?
claim $held "with its map of $mapped maplets: $(maplets) are there"
said=$(systemd-run --quiet --pipe --wait -p MemoryMax=24M -p MemorySwapMax=0 mapletd --no-dds --source sim:room 2>&1)
[[ $? = 2 && $said = *"the control group allows 24 MiB"* && $said = *"patches/"*"total"* ]]
held=$?
claim $held "a control group that is too small is refused, with the ledger: ${said%%$'\n'*}"

mapletctl check | sed 's/^/check: /'
systemctl stop mapletd
held=$?
claim $held "it stops"
stands 0 0
held=$?
claim $held "tracking is off the line"
said=$(/opt/proof/hil_libcamera --gtest_color=no 2>&1) && [[ $said != *SKIPPED* ]]
held=$?
claim $held "hil_libcamera with vimc: $(grep -E 'FAILED|SKIPPED|PASSED|Failure' <<<"$said" | tr '\n' ' ')"
claim 0 "the end"
echo "log:"
journalctl -u mapletd --no-pager -o cat | tail -20
systemctl poweroff
