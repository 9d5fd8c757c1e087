#!/bin/bash
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
# The man pages name every command and every configuration key, and roff takes them as they are.
#   man_test.sh SOURCE_DIR BIN_DIR
set -eu
pages=$(mktemp -d)
trap 'rm -rf "$pages"' EXIT
"$1/tools/man" "$2" "$pages"
failures=0
wrong() {
  echo "$*"
  failures=$((failures + 1))
}

commands=$("$2/mapletctl" --help | sed -n '/^Subcommands:/,$s/^  \([a-z][a-z-]*\).*/\1/p')
[[ -n $commands ]]
for command in $commands; do
  grep -qxF ".SS \"${command//-/\\-}\"" "$pages/mapletctl.1" || wrong "mapletctl.1 lacks $command"
done
keys=$("$2/mapletd" --print-config | sed -n 's/^\([A-Za-z_0-9]*\) *=.*/\1/p')
[[ $(wc -w <<<"$keys") -gt 20 ]]
for key in $keys; do
  grep -q "^\.B $key = " "$pages/mapletd.toml.5" || wrong "mapletd.toml.5 lacks $key"
done
for option in --source --out --pace --print-config; do
  grep -qF -- "${option//-/\\-}" "$pages/mapletd.8" || wrong "mapletd.8 lacks $option"
done
if command -v groff >/dev/null; then
  for page in "$pages"/*; do
    said=$(groff -man -Tutf8 -ww "$page" 2>&1 >/dev/null)
    [[ -z $said ]] || wrong "${page##*/}: $said"
  done
fi
exit $((failures > 0))
