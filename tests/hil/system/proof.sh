#!/bin/bash
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
# Inside the booted system (boot_test.sh): the service as its users have it. A line a claim, PASS or
# FAIL, into /opt/proof/result; then the machine goes off.
cycles=${1:-10}
exec >/opt/proof/result 2>&1

claim() { # HELD WORDS... : the exit status of what was looked at
  local held=$1
  shift
  if [[ $held = 0 ]]; then echo "PASS  $*"; else echo "FAIL  $*"; fi
}
soon() { # SECONDS COMMAND...
  local end=$((SECONDS + $1))
  shift
  until "$@" >/dev/null 2>&1; do
    [[ $SECONDS -lt $end ]] || return 1
    sleep 0.1
  done
}
status() { mapletctl status --json; }
show() { systemctl show mapletd -P "$1"; }
running() { status | jq -e '(.state == "running" or .state == "degraded") and .frames.processed > 20 and .tracking.now'; }
ms() { echo $(($(date +%s%N) / 1000000)); }

soon 20 systemctl -q is-active mapletd
held=$?
claim $held "enabled, it is ready after boot"
if ! systemctl -q is-active mapletd; then
  journalctl -u mapletd --no-pager -o cat | tail -20
  systemctl poweroff
  exit
fi
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

before=$(show MainPID)
kill -STOP "$before"
soon 20 bash -c "[[ \$(systemctl show mapletd -P MainPID) != $before && \$(systemctl show mapletd -P ActiveState) = active ]]"
held=$?
claim $held "a hung process is killed by the watchdog and comes back ($(show NRestarts) restarts)"
soon 20 running
held=$?
claim $held "and tracks again"

systemctl reload mapletd
held=$?
claim $held "reload"

most=0
for ((i = 0; i < cycles; i++)); do
  systemctl reset-failed mapletd
  begin=$(ms)
  systemctl stop mapletd
  took=$(($(ms) - begin))
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
systemctl start mapletd@2 && soon 20 mapletctl status --agent 2
held=$?
claim $held "a second agent beside it"
echo "exposure: $(systemd-analyze security mapletd --no-pager 2>/dev/null | grep Overall)"
echo "log:"
journalctl -u mapletd --no-pager -o cat | tail -20
systemctl poweroff
