#!/bin/bash
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
# The units hold the limits of the default configuration, are well formed, and are locked up.
#   unit_test.sh UNIT_DIR MAPLETD
set -eu
units=$1 mapletd=$2
failures=0
wrong() {
  echo "$*"
  failures=$((failures + 1))
}

while IFS== read -r key value; do
  for unit in mapletd.service mapletd@.service; do
    grep -qxF "$key=$value" "$units/$unit" ||
      wrong "$unit: $key is not $value, as --print-unit-limits says (systemd/CMakeLists.txt)"
  done
done < <("$mapletd" --print-unit-limits | grep -E '^[A-Z][A-Za-z]+=')

# The ledger's bars: default limits (512 own, 1024 foreign maplets) at both sizes, with the journal.
most() { # MIB OPTIONS...
  local mib=$1 total
  shift
  total=$("$mapletd" --print-memory --state /tmp "$@" | awk '$1 == "total" { print $2 }')
  echo "ledger with $*: $((total / 1024)) KiB of $((mib * 1024))"
  [[ $total -gt 0 && $total -le $((mib * 1048576)) ]] || wrong "the ledger is over its bar"
}
most 48 --set limits.image_width_px=320 --set limits.image_height_px=240
most 128

if ! command -v systemd-analyze >/dev/null; then
  echo "the rest is SKIPPED: no systemd-analyze"
  exit $((failures > 0))
fi
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for unit in mapletd.service mapletd@.service; do
  # The program and the manual are not installed where this runs.
  sed -e "s,^ExecStart=[^ ]*,ExecStart=$mapletd," -e '/^Documentation=/d' \
    "$units/$unit" >"$folder/${unit/@/@1}"
  said=$(systemd-analyze verify "$folder/${unit/@/@1}" 2>&1)
  [[ -z $said ]] || wrong "$unit: $said"
  systemd-analyze security --offline=true --threshold=25 --no-pager "$folder/${unit/@/@1}" \
    >"$folder/security" 2>&1 || wrong "$unit: $(grep Overall "$folder/security")"
done
exit $((failures > 0))
