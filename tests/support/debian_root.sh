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

debian_root() { # NAME PACKAGES(comma separated) FOLDER [ARCHITECTURE]: unpacks it into FOLDER
  local cache=${XDG_CACHE_HOME:-$HOME/.cache}/mapletd arch=${4:-$(dpkg --print-architecture)} base
  base=$cache/$1-$(echo "$arch $2" | md5sum | cut -c1-12).tar
  mkdir -p "$cache" "$3"
  if [[ ! -f $base ]]; then
    echo "making a Debian root ($1)"
    # The release without its updates, as the sysroots: whoever runs on its oldest packages runs on newer ones.
    mmdebstrap --quiet --format=tar --variant=minbase --architectures="$arch" --include="$2" bookworm "$base.new" \
      "deb http://deb.debian.org/debian bookworm main" ||
      { rm -f "$base.new"; exit 1; }
    mv "$base.new" "$base"
  fi
  tar -C "$3" -xf "$base"
}

next_version() { # DEB FOLDER NEW_DEB: the same package as a later version, its configuration changed
  dpkg-deb -R "$1" "$2"
  sed -i 's/^Version: .*/&+next/' "$2/DEBIAN/control"
  echo "# theirs" >>"$2/etc/mapletd/mapletd.toml"
  dpkg-deb -b "$2" "$3" >/dev/null
}
