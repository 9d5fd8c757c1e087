#!/bin/sh
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
# mapletd for 32-bit ARM on processors without NEON says so and ends with 1; with NEON it runs.
#   neon_missing_test.sh MAPLETD EMULATOR...
set -u
mapletd=$1
shift
"$@" -cpu cortex-a9 "$mapletd" --help >/dev/null || { echo "it does not run on a processor with NEON"; exit 1; }
for cpu in cortex-a9,neon=off cortex-a15,neon=off; do
  said=$("$@" -cpu "$cpu" "$mapletd" --help 2>&1)
  status=$?
  echo "$cpu: $status, $said"
  [ $status = 1 ] && [ "$said" = "mapletd: this processor has no NEON, which the 32-bit ARM build needs" ] || exit 1
done
