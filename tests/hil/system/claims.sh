# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
# For what looks at the service inside a booted system; sourced. A line a claim into /opt/proof/result.
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
# Not by jq's status, which is 0 where nobody answers.
running() { [[ $(status | jq '(.state == "running" or .state == "degraded") and .frames.processed > 20 and .tracking.now') = true ]]; }
ms() { echo $(($(date +%s%N) / 1000000)); }
maplets() { mapletctl maplets --json | jq length; }
mapped() { [[ $(maplets) -ge $1 ]]; }
safe() { # COUNT: so many maplets are on the disk
  [[ $(status | jq '.journal.flushed.maplets // 0') -ge $1 ]]
}
restarted() { # PID_BEFORE
  [[ $(show MainPID) != "$1" && $(show ActiveState) = active ]]
}

# Stops the estimator's thread, which is the main one, and no other: by the debugger's call. Whoever
# traces it must live on, or it would go on; and end with it, or its remains would stay.
hang_estimator() { # PID
  perl -e 'my $t = int($ARGV[0]);
           syscall(101, 0x4206, $t, 0, 0) == 0 or die "PTRACE_SEIZE: $!\n";
           syscall(101, 0x4207, $t, 0, 0) == 0 or die "PTRACE_INTERRUPT: $!\n";
           my $wall = 0x40000000;  # any thread; 9 is SIGKILL
           1 while waitpid($t, $wall) == $t && $? != 9' "$1" &
}

# The service does not come up: what it says, and the end.
give_up() {
  journalctl -u mapletd --no-pager -o cat | tail -20
  systemctl poweroff
  exit
}
