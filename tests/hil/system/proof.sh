#!/bin/bash
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
# Inside the booted system (boot_test.sh): the service as its users have it; then the machine goes off.
cycles=${1:-10}
. "$(dirname "$0")/claims.sh"

soon 20 systemctl -q is-active mapletd
held=$?
claim $held "enabled, it is ready after boot"
systemctl -q is-active mapletd || give_up
soon 20 running
held=$?
claim $held "it tracks the camera: $(show StatusText)"
[[ $(ps -o user= -p "$(show MainPID)") = mapletd ]]
held=$?
claim $held "it runs as its own user"
[[ $(show MemoryCurrent) = "[not set]" || $(show MemoryCurrent) -le $(show MemoryMax) ]]
held=$?
claim $held "memory $(show MemoryCurrent) within $(show MemoryMax)"
[[ $(status | jq .memory.heap_allocations_after_ready) = 0 ]]
held=$?
claim $held "no allocation after READY"
may_lock=$(awk '/Max locked memory/ { print $5 }' "/proc/$(show MainPID)/limits")
if [[ $may_lock != unlimited && $may_lock -lt $(status | jq .memory.arena_bytes) ]]; then
  echo "SKIPPED  the arena is locked: this machine grants $may_lock bytes to nobody"
else
  [[ $(status | jq .memory.locked) = true ]]
  held=$?
  claim $held "the arena is locked"
fi
[[ $(status | jq .memory.rss_bytes) -le $(show MemoryMax) ]]
held=$?
claim $held "resident memory $(status | jq .memory.rss_bytes) within $(show MemoryMax)"
[[ $(stat -c '%a %U %G' /run/mapletd/agent-0.sock) = "660 mapletd mapletd" ]] &&
  ! setpriv --reuid=nobody --regid=nogroup --clear-groups mapletctl status
held=$?
claim $held "its socket is for the group mapletd alone: $(stat -c '%A %U %G' /run/mapletd/agent-0.sock)"

soon 60 safe 2
held=$?
claim $held "two maplets are on the disk"
mapped=$(status | jq '.journal.flushed.maplets')
epoch=$(status | jq .epoch)
before=$(show MainPID)
hang_estimator "$before"
begin=$(ms)
soon 30 restarted "$before"
held=$?
took=$(($(ms) - begin))
claim $((held + (took > 10000))) "a hung estimator is killed by the watchdog and comes back: $took ms, WatchdogSec=$(show WatchdogUSec)"
soon 20 running
held=$?
claim $held "and tracks again"
[[ $(status | jq .epoch) = "$epoch" ]] && mapped "$mapped"
held=$?
claim $held "with its map of $mapped maplets: $(maplets) are there"

before=$(show MainPID)
kill -STOP "$before"
soon 30 restarted "$before"
held=$?
claim $held "so is a process that stands still ($(show NRestarts) restarts)"
soon 20 running

systemctl reload mapletd
held=$?
claim $held "reload"

most=0
for ((i = 0; i < cycles; i++)); do
  systemctl reset-failed mapletd
  systemctl stop mapletd
  took=$((($(show InactiveEnterTimestampMonotonic) - $(show ActiveExitTimestampMonotonic)) / 1000)) # systemctl's own time apart
  [[ $took -le $most ]] || most=$took
  systemctl start mapletd || break
done
[[ $i = "$cycles" && $most -le 1000 ]]
held=$?
claim $held "$i of $cycles stops and starts, the longest stop $most ms"
systemctl reset-failed mapletd
begin=$(ms)
systemctl restart mapletd
held=$?
took=$(($(ms) - begin))
claim $held "a restart takes $took ms to READY"
mapped "$mapped"
held=$?
claim $held "the map is still there: $(maplets) maplets"
systemctl start mapletd@2 && soon 20 mapletctl status --agent 2
held=$?
claim $held "a second agent beside it"
systemctl stop mapletd@2
journalctl --sync
[[ $(journalctl -o json MAPLETD_AGENT=2 | jq -r 'select(.SYSLOG_IDENTIFIER == "mapletd" and .MAPLETD_VERSION)._SYSTEMD_UNIT' | sort -u) = mapletd@2.service ]]
held=$?
claim $held "the journal finds its lines by its number: $(journalctl -o cat MAPLETD_AGENT=2 | head -1)"

exposure=$(systemd-analyze security mapletd --no-pager 2>/dev/null | grep Overall)
echo "exposure: $exposure"
echo "log:"
journalctl -u mapletd --no-pager -o cat | tail -20
systemctl poweroff
