# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
# Completion for mapletd and mapletctl in bash. It asks the programs themselves (--help,
# --print-config), so it knows every command, option and key that they know.
#
# Installed as /usr/share/bash-completion/completions/mapletd, with a link mapletctl beside it; or
#   source config/completion/mapletd.bash

# Commands of a help text.
_mapletd_commands() {
  awk '/^[^ ]/ { on = /^Subcommands:/ } on && /^  [a-z]/ { print $1 }' <<<"$1"
}

# Options of a help text; their other spellings too.
_mapletd_options() {
  awk '/^ +-/ { n = split($1, names, ","); for (i = 1; i <= n; ++i) print names[i] }' <<<"$1"
}

# What an option or, without one, the positional argument takes: FILE, DIR, URI...; empty for a flag.
_mapletd_takes() {
  awk -v option="$2" '
    /^[^ ]/ { positionals = /^Positionals:/ }
    option == "" { if (positionals && /^  [^ ]/) { print $2; exit } next }
    /^ +-/ && index("," $1 ",", "," option ",") { if (NF > 1 && $2 ~ /^[A-Z<a-z]+[|:=A-Z]|^[A-Z]+$/) print $2; exit }
  ' <<<"$1"
}

# Keys of the configuration, section.key=.
_mapletd_keys() {
  "$1" --print-config 2>/dev/null | awk '
    /^\[/ { section = substr($1, 2, index($1, "]") - 2) "."; next }
    /^#? ?[a-z][A-Za-z0-9_.]* *=/ { sub(/^#? ?/, ""); sub(/ *=.*/, ""); print section $0 "=" }'
}

_mapletd() {
  local program=$1 current=$2 previous=$3 word help takes
  local -a path=("$program")
  COMPREPLY=()
  help=$("${path[@]}" --help 2>/dev/null) || return
  for word in "${COMP_WORDS[@]:1:COMP_CWORD-1}"; do
    if _mapletd_commands "$help" | grep -qxF -- "$word"; then
      path+=("$word")
      help=$("${path[@]}" --help 2>/dev/null) || return
    fi
  done

  if [[ $current == -* ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$(_mapletd_options "$help")" -- "$current")
    return
  fi
  if [[ $previous == --set ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$(_mapletd_keys "$program")" -- "$current")
    compopt -o nospace 2>/dev/null
    return
  fi
  if [[ $previous == -* ]]; then
    takes=$(_mapletd_takes "$help" "$previous")
  elif [[ $previous == : || $current == : ]]; then  # behind "tum:"
    takes=FILE
    [[ $current == : ]] && current=
  else
    local commands
    commands=$(_mapletd_commands "$help")
    if [[ -n $commands ]]; then
      mapfile -t COMPREPLY < <(compgen -W "$commands" -- "$current")
      return
    fi
    takes=$(_mapletd_takes "$help" "")
  fi
  case $takes in
    DIR*) compopt -o filenames 2>/dev/null; mapfile -t COMPREPLY < <(compgen -d -- "$current") ;;
    URI*)
      compopt -o nospace 2>/dev/null
      mapfile -t COMPREPLY < <(compgen -W "tum: openni2: sim:room sim:loop sim:corridor record:" \
        -- "$current")
      ;;
    ?*) compopt -o filenames 2>/dev/null; mapfile -t COMPREPLY < <(compgen -f -- "$current") ;;
  esac
}
complete -F _mapletd mapletd mapletctl
