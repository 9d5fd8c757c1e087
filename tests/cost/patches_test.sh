#!/bin/sh
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
# Instructions of a frame of the patches stage, from back-projection to the written result, on seeded
# frames. A count does not depend on what else the machine does: it guards what a time cannot.
#   patches_test.sh MAPLETCTL LIMITS    LIMITS: lines `most-instructions-a-frame source`
set -eu
mapletctl=$1
limits=$2
skip() { echo "SKIPPED: $1"; exit 77; }
command -v valgrind >/dev/null || skip "valgrind is not installed"
grep -qw avx2 /proc/cpuinfo 2>/dev/null || skip "the limits are those of a processor with AVX2"
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
status=0
grep -v '^#' "$limits" | while read -r most source; do
  frames=$(valgrind --tool=callgrind --callgrind-out-file="$out/callgrind" \
    --toggle-collect='maplet::PatchExtractor::run(*' --log-file="$out/log" \
    "$mapletctl" patches-eval --json "$source" | sed 's/.*"frames":\([0-9]*\).*/\1/')
  all=$(sed -n 's/.*Collected : \([0-9]*\)$/\1/p' "$out/log")
  [ -n "$all" ] && [ "$frames" -gt 0 ] && [ "$all" -gt 100000 ] || { echo "no count"; exit 1; }
  each=$((all / frames))
  echo "$source: $each instructions a frame, at most $most"
  [ "$each" -le "$most" ] || exit 1
done || status=1
exit $status
