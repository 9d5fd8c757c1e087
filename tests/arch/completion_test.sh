#!/bin/bash
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
# Bash completion offers every command and option that mapletctl itself knows.
#   completion_test.sh SOURCE_DIR MAPLETCTL
set -eu
source "$1/config/completion/mapletd.bash"
mapletctl=$2
failures=0

# complete_words WORD...: what is offered for the last word, sorted on one line.
complete_words() {
  COMP_WORDS=("$mapletctl" "$@")
  COMP_CWORD=$#
  local previous=${COMP_WORDS[COMP_CWORD - 1]}
  _mapletd "$mapletctl" "${COMP_WORDS[COMP_CWORD]}" "$previous"
  printf '%s\n' "${COMPREPLY[@]}" | sort | paste -sd ' '
}

expect() { # WANTED WORD...
  local wanted=$1
  shift
  local got
  got=$(complete_words "$@")
  [[ $got == "$wanted" ]] && return
  echo "for '$*' wanted: $wanted"
  echo "       got: $got"
  failures=$((failures + 1))
}

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
mkdir "$folder/run_a"
touch "$folder/run.txt"

expect eval ev
expect --truth eval --tr
expect "--estimate --help --json --truth -h" eval -
expect "$folder/run.txt $folder/run_a" eval --truth "$folder/run"
expect "$folder/run_a" draw "$folder/run"
expect "" version x
expect "" no-such-command --x

# Every command, as the help lists them to a person, is offered and has its own options.
listed=$("$mapletctl" --help | sed -n '/^Subcommands:/,$s/^  \([a-z][a-z-]*\) .*/\1/p' | sort | paste -sd ' ')
[[ -n $listed ]]
expect "$listed" ""
for command in $listed; do
  for option in $("$mapletctl" "$command" --help | grep -oE '^ +(-[a-z],)?--[a-z0-9-]+' |
    grep -oE -- '--.*'); do
    expect "$option" "$command" "$option"
  done
done
exit $((failures > 0))
