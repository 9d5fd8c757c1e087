#!/usr/bin/env bash
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
# What `mapletctl demo` runs: two agents map a simulated building, meet, and merge their maps.
#   demo.sh BIN_DIR OUT_DIR
# MAPLET_DEMO_SET=key=value is one more setting of both agents: a longer frame.budget_us where the machine has other work.
set -euo pipefail
bin=$1 dir=$2
command -v jq >/dev/null || { echo "demo: needs jq; as root: apt install jq" >&2; exit 1; }
made_by="made by mapletctl demo" # only such a folder is emptied
if [ -d "$dir" ] && [ -n "$(ls -A "$dir")" ] && ! grep -qsx "$made_by" "$dir/README"; then
  echo "demo: $dir is not empty and no earlier demo's; name another --out" >&2
  exit 1
fi
rm -rf "$dir" 2>/dev/null || true
mkdir -p "$dir" && echo "$made_by" >"$dir/README" ||
  { echo "demo: $dir cannot be written; name another --out" >&2; exit 1; }
pids=()
sockets=$(mktemp -d) # not in $dir: a socket's path is short
trap 'kill "${pids[@]}" 2>/dev/null || true; rm -rf "$sockets"' EXIT
domain=$((100 + RANDOM % 100))
source_of() { echo "sim:loop?seed=7&width=$2&frames=1800&agent=$1&phase=$([ "$1" = 1 ] && echo 0.0 || echo 0.45)"; }
ask() { "$bin/mapletctl" "${@:2}" --socket "$sockets/$1.sock"; }

echo
echo "1. Two robots walk a simulated building from different places; neither knows where the other began."
for agent in 1 2; do
  "$bin/mapletctl" simulate "$(source_of $agent 160)" --out "$dir/truth$agent" >/dev/null 2>&1 &
  truths[agent]=$!
  "$bin/mapletd" --agent $agent --source "$(source_of $agent 320)" --out "$dir/agent$agent" \
    --set "dds.domain=$domain" --set dds.budget_bytes_per_s=100000 --set exchange.linger_s=600 \
    --set "control.socket=$sockets/$agent.sock" ${MAPLET_DEMO_SET:+--set "$MAPLET_DEMO_SET"} 2>"$dir/agent$agent.log" &
  pids[agent]=$!
done
"$bin/mapletctl" watch --domain "$domain" --json --kind delta-pose --timeout-s 1200 >"$dir/watched.jsonl" &
pids[3]=$!

flying() { kill -0 "${pids[1]}" && kill -0 "${pids[2]}"; } 2>/dev/null
wait_for() { # seconds, command: until it succeeds, as long as both agents run
  local end=$((SECONDS + $1))
  until "${@:2}" >/dev/null 2>&1; do
    [ $SECONDS -lt $end ] && flying || return 1
    sleep 0.2
  done
}
heard() { [ "$(ask "$1" peers --json | jq length)" -ge 1 ]; }
frames_at_least() { [ "$(ask "$1" status --json | jq .frames.processed)" -ge "$2" ]; }
merged() { [ "$(ask "$1" why $((3 - $1)) --json | jq .merged)" = true ]; }
in_sync() { [ "$(ask "$1" status --json | jq .exchange.in_sync)" = true ]; }

wait_for 60 heard 1 || true
echo "2. They hear each other, then fall silent: a dropout. Each maps on alone."
for agent in 1 2; do ask $agent radio silent; done
alone=0
for agent in 1 2; do wait_for 600 frames_at_least $agent 1700 || true; done
! merged 1 && alone=1
echo "3. They meet: delta-poses first, closures, then maplets; places that both saw tie the maps together."
for agent in 1 2; do ask $agent radio on; done
met=0
wait_for 300 merged 1 && wait_for 60 merged 2 && met=1
echo "4. Somebody claims, wrongly, that two far places are one."
ask 1 closure add 1:2 2:6 3,-2,40,0,0.7,0,0.714 || true
false_rejected() { [ "$(ask "$1" closure list --json | jq '[.[] | select(.a.id == 2 and .b.id == 6 and .length_m > 35)] | map(.rejected) | all and length >= 1')" = true ]; }
rejected=0
wait_for 60 false_rejected 1 && wait_for 60 false_rejected 2 && rejected=1
for agent in 1 2; do wait "${pids[agent]}" || { cat "$dir/agent$agent.log"; exit 1; }; done
kill "${pids[3]}" 2>/dev/null || true
wait "${pids[3]}" || true # what it read is in its file when it has ended
wait "${truths[@]}"

# Before the meeting each map stands at its own origin.
for agent in 1 2; do
  mkdir -p "$dir/before$agent"
  cp -r "$dir/agent$agent/maplets" "$dir/before$agent/"
  cp "$dir/agent$agent/skeleton_alone.g2o" "$dir/before$agent/skeleton.g2o"
  cp "$dir/agent$agent/odometry.tum" "$dir/before$agent/trajectory.tum"
done
"$bin/mapletctl" draw "$dir/before1" "$dir/before2" --title "Before the meeting: each in its own frame" >/dev/null
"$bin/mapletctl" draw "$dir/agent1" "$dir/agent2" --title "After the meeting: one frame" >/dev/null
cp "$dir/before1/map.png" "$dir/before.png"
cp "$dir/agent1/map.png" "$dir/after.png"

# Both trajectories in one file, the second one's stamps an hour later: one alignment for both.
for kind in truth before after; do
  for agent in 1 2; do
    case $kind in
      truth) file=$dir/truth$agent/groundtruth.txt ;;
      before) file=$dir/before$agent/trajectory.tum ;;
      after) file=$dir/agent$agent/trajectory.tum ;;
    esac
    awk -v later=$(((agent - 1) * 3600)) '!/^#/ { $1 = sprintf("%.6f", $1 + later); print }' "$file"
  done >"$dir/$kind.tum"
done
ate() { "$bin/mapletctl" eval --truth "$dir/truth.tum" --estimate "$dir/$1.tum" --json | jq -r .ate_rms_m; }
path=$(for agent in 1 2; do "$bin/mapletctl" eval --truth "$dir/truth$agent/groundtruth.txt" --estimate "$dir/agent$agent/trajectory.tum" --json; done | jq -s 'map(.path_m) | add')

echo
echo "5. What came out"
failed=0
row() { # text, figure, limit, condition (awk)
  local verdict=PASS
  awk "BEGIN { exit !($4) }" || { verdict=FAIL; failed=1; }
  printf '  %-46s %14s   %-18s %s\n' "$1" "$2" "$3" "$verdict"
}
both() { jq -s "map($1) | $2" "$dir/agent1/report.json" "$dir/agent2/report.json"; }
before=$(ate before) after=$(ate after)
clouds=$(both '.maplets.point_cloud_bytes_mean * .maplets.count' add)
wire=$(both '.exchange.wire_bytes' add)
ratio=$(awk "BEGIN { printf \"%.0f\", $clouds / $wire }")
deltas=$(both '.delta_poses.count - .delta_poses.closures' add)
shared=$(both '.exchange.maplets_received' add) maplets=$(both '.maplets.count' add)
delta_bytes=$(both '.exchange.delta_pose_bytes' add)
lines=$(cat "$dir"/agent?/delta_poses.jsonl | wc -l)
arena=$(both '.memory.arena_bytes' max) rss=$(both '.memory.peak_rss_bytes' max)
cpu=$(both '.stages.frame.cpu_p99_us' max)

row "delta-poses, closures apart" "$deltas" ">= 15" "$deltas >= 15"
row "alone during the dropout, merged after it" "$([ $alone$met = 11 ] && echo yes || echo no)" "yes" "$alone && $met"
row "error of both in one frame, before (ATE rms)" "$(awk "BEGIN{printf \"%.2f m\", $before}")" "(no relation yet)" "$before > $after"
row "error of both in one frame, after" "$(awk "BEGIN{printf \"%.3f m\", $after}")" "<= 1.5 % of $(awk "BEGIN{printf \"%.0f\", $path}") m" "$after <= 0.015 * $path"
row "false closure rejected by both" "$([ $rejected = 1 ] && echo yes || echo no)" "yes" "$rejected"
row "maplets shared" "$shared of $maplets" "all" "$shared == $maplets"
row "IP bytes sent, DDS and all" "$wire B" "(both agents)" "$wire > 0"
row "point clouds / bytes sent (320 x 240 pixels)" "$ratio x" ">= 100 x" "$ratio >= 100"
row "of these for delta-poses, a record" "$(awk "BEGIN{printf \"%.0f B\", $delta_bytes / $deltas}")" "<= 256 B" "$delta_bytes <= 256 * $deltas"
row "records seen by the local watcher" "$(wc -l <"$dir/watched.jsonl") of $lines" "all" "$(wc -l <"$dir/watched.jsonl") == $lines"
row "CPU time of a frame, p99" "$(awk "BEGIN{printf \"%.1f ms\", $cpu/1000}")" "<= 15 ms" "$cpu <= 15000"
misses=$(both '.stages.frame.deadline_misses' add) frames=$(both '.frames.processed' add)
row "deadline misses (frame's budget)" "$misses of $frames" "<= 10 %" "$misses * 10 <= $frames"
row "heap allocations after start" "$(both '.memory.heap_allocations_after_ready' add)" "0" "$(both '.memory.heap_allocations_after_ready' add) == 0"
row "memory of the stages (fixed)" "$(awk "BEGIN{printf \"%.1f MiB\", $arena/1048576}")" "<= 128 MiB" "$arena <= 134217728"
row "peak memory of a process" "$(awk "BEGIN{printf \"%.1f MiB\", $rss/1048576}")" "<= 160 MiB" "$rss <= 167772160"
echo
echo "  The maps:       $dir/before.png   $dir/after.png"
echo "  Everything:     $dir/agent1/ $dir/agent2/   (report.json, map.svg, skeleton.g2o, ...)"
exit "$failed"
