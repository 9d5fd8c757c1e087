# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
# For tests in a Debian 12 of their own; sourced. Made once, kept as a tarball in ~/.cache/mapletd.

# Ends the script as skipped where a program or the rights are missing.
needs() { # PROGRAMS...
  local program
  for program; do
    command -v "$program" >/dev/null || { echo "SKIPPED: no $program (tools/setup system)"; exit 0; }
  done
  [[ $(id -u) = 0 ]] || { echo "SKIPPED: not root"; exit 0; }
}

debian_root() { # NAME PACKAGES(comma separated) FOLDER: unpacks it into FOLDER
  local cache=${XDG_CACHE_HOME:-$HOME/.cache}/mapletd base
  base=$cache/$1-$(echo "$2" | md5sum | cut -c1-12).tar
  mkdir -p "$cache" "$3"
  if [[ ! -f $base ]]; then
    echo "making a Debian root ($1)"
    mmdebstrap --quiet --format=tar --variant=minbase --include="$2" bookworm "$base.new" ||
      { rm -f "$base.new"; exit 1; }
    mv "$base.new" "$base"
  fi
  tar -C "$3" -xf "$base"
}
