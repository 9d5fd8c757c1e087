#!/bin/bash
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
# Packs the build as a .deb and takes it through its life in a bare Debian 12 without systemd: install,
# run, read-only disk, upgrade over an edited configuration, remove, purge.
#   deb_test.sh BUILD_DIR
# As root. Needs mmdebstrap (tools/setup system) and, the first time, the network. lintian where it is.
# A package for another processor lives in a root of that processor, its programs run by qemu-user: the
# kernel is told (binfmt_misc, in mounts of this test's own) for as long as the test runs.
set -eu
build=$1
. "$(dirname "$0")/../support/debian_root.sh"
needs mmdebstrap

emulator=$(sed -n 's/^MAPLET_EMULATOR:[A-Z]*=//p' "$build/CMakeCache.txt")
binfmt=/proc/sys/fs/binfmt_misc
emulated=$binfmt/$(basename "${emulator:-none}" -static)
if [[ -n $emulator && -z ${MAPLET_OWN_MOUNTS:-} ]]; then
  MAPLET_OWN_MOUNTS=1 exec unshare --mount "$0" "$@"
elif [[ -n $emulator && ! -e $emulated ]]; then
  { [[ -e $binfmt/register ]] || mount -t binfmt_misc none $binfmt; } &&
    cat "/usr/lib/binfmt.d/${emulated##*/}.conf" >$binfmt/register || true
fi

failed=0
claim() { # WORDS COMMAND... : what it says goes to $work/said, what the one before said to $work/before
  local words=$1
  shift
  [[ ! -f $work/said ]] || mv "$work/said" "$work/before"
  if "$@" >"$work/said" 2>&1; then
    echo "PASS  $words"
  else
    echo "FAIL  $words"
    sed 's/^/      /' "$work/said"
    failed=1
  fi
}

refused() { ! "$@"; }

work=$(mktemp -d "${TMPDIR:-/var/tmp}/mapletd-deb.XXXXXX")
trap 'rm -rf --one-file-system "$work"' EXIT
(cd "$build" && cpack -B "$work" >"$work/cpack.log" 2>&1) || { cat "$work/cpack.log"; exit 1; }
deb=$(ls "$work"/mapletd_*.deb)
depends=$(dpkg-deb -f "$deb" Depends | sed 's/([^)]*)//g; s/ //g')
arch=$(dpkg-deb -f "$deb" Architecture)
echo "$(basename "$deb"): $(($(stat -c %s "$deb") / 1024)) KiB, $(dpkg-deb -f "$deb" Installed-Size) KiB installed"

if command -v lintian >/dev/null; then
  claim "lintian finds no error" lintian --allow-root --fail-on error --tag-display-limit 0 "$deb"
else
  echo "SKIPPED  lintian is not here"
fi
strip_kib=$(dpkg-deb --fsys-tarfile "$deb" | tar -tv --wildcards './usr/bin/*' | awk '{ s += $3 } END { print int(s / 1024) }')
if grep -qx 'CMAKE_BUILD_TYPE:[A-Z]*=Release' "$build/CMakeCache.txt"; then
  claim "programs of $strip_kib KiB, at most 6 MB" test "$strip_kib" -le 5859
else
  echo "SKIPPED  the programs' size, $strip_kib KiB: not a release"
fi

"$(dirname "$0")/neon_claims.sh" "$deb" || failed=1

if [[ -n $emulator ]] && ! grep -qs "^enabled" "$emulated"; then
  echo "SKIPPED  its life: this kernel runs no $arch programs"
  exit $failed
fi
root=$work/root
debian_root deb "$depends,jq,fonts-open-sans" "$root" "$arch"
in_root() { # MOUNTS(shell commands, the root is $1) COMMAND... : with the root's own /proc
  local mounts=$1
  shift
  unshare --mount sh -euc "mount --make-rprivate /; mount -t proc proc \"\$1/proc\"; $mounts; exec chroot \"\$@\"" sh "$root" "$@"
}
inside() { in_root : "$@"; }
"$(dirname "$0")/dependencies.sh" "$root" "$depends"

cp "$deb" "$root/mapletd.deb"
# Inside, on a disk that cannot be written, but for /tmp.
read_only() {
  in_root 'mount --rbind "$1" "$1"; mount -o remount,ro,bind "$1"; mount -t tmpfs none "$1/tmp"' "$@"
}
claim "a read-only root is not half installed" refused read_only dpkg -i /mapletd.deb
claim "and says why" grep -qi "read-only" "$work/before"
claim "dpkg knows nothing of it" refused inside dpkg -s mapletd
claim "it installs where there is no systemd" inside dpkg -i /mapletd.deb
claim "its user is there" inside getent passwd mapletd
claim "it runs" inside mapletd --source 'sim:room?frames=30&width=320' --no-dds --out /tmp/run
claim "and left a map" test -s "$root/tmp/run/map.svg"
claim "it runs on a read-only root" read_only mapletd --source 'sim:room?frames=30&width=320' --no-dds --out /tmp/run
claim "with a state folder that is read-only it goes on in memory" read_only mapletd --source 'sim:room?frames=30&width=320' \
  --no-dds --out /tmp/run --state /var/lib/mapletd
claim "and says so in one line" test "$(grep -c "/var/lib/mapletd: Read-only file system" "$work/said")" = 1
if [[ $arch = $(dpkg --print-architecture) ]]; then
  # What it does, not how long it takes: other tests may run beside it.
  claim "the demo runs from the package alone" inside env MAPLET_DEMO_SET=frame.budget_us=1000000 mapletctl demo --out /tmp/demo
  claim "and left its pictures" test -s "$root/tmp/demo/after.png"
else
  claim "the demo is there" inside bash -c 'test -x /usr/libexec/mapletd/demo && mapletctl demo --help'
fi
claim "no camera is said in one line" refused inside mapletd --source openni2: --no-dds --out /tmp/none
claim "and nothing else" test "$(wc -l <"$work/said")" = 1

# The next version, over a configuration that its owner edited.
echo "# mine" >>"$root/etc/mapletd/mapletd.toml"
mkdir -p "$root/var/lib/mapletd" && touch "$root/var/lib/mapletd/map"
next_version "$deb" "$work/next" "$root/next.deb"
claim "it upgrades" inside dpkg --force-confdef --force-confold -i /next.deb
claim "an edited configuration stays" grep -qx "# mine" "$root/etc/mapletd/mapletd.toml"

claim "it is removed" inside dpkg -r mapletd
claim "the programs are gone" test ! -e "$root/usr/bin/mapletd"
claim "the maps stay" test -e "$root/var/lib/mapletd/map"
claim "it is purged" inside dpkg -P mapletd
left=$(find "$root/etc" "$root/usr" "$root/var/lib/mapletd" \( -name '*mapletd*' -o -name '*mapletctl*' \) -not -path '*/dpkg/*' 2>/dev/null || true)
claim "nothing is left: $left" test -z "$left"
claim "nor its user" bash -c "! chroot '$root' getent passwd mapletd"
exit $failed
