#!/bin/bash
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
# A processor without NEON is refused before anything is unpacked: the package's preinst on boards that
# are written down here.
#   neon_claims.sh DEB
set -eu
work=$(mktemp -d "${TMPDIR:-/var/tmp}/mapletd-neon.XXXXXX")
trap 'rm -rf --one-file-system "$work"' EXIT
dpkg-deb -e "$1" "$work/control"
failed=0

# ARCHITECTURE FEATURES: the preinst there.
preinst_on() {
  printf '#!/bin/sh\necho %s\n' "$1" >"$work/dpkg"
  chmod +x "$work/dpkg"
  printf 'processor\t: 0\n%s\n' "$2" >"$work/cpuinfo"
  unshare --mount sh -euc 'mount --make-rprivate / && mount --bind "$1/cpuinfo" /proc/cpuinfo &&
    PATH=$1:$PATH exec sh "$1/control/preinst" install' sh "$work" >"$work/said" 2>&1
}
claim() { # EXPECTED(0|1) WORDS ARCHITECTURE FEATURES
  local status=0
  preinst_on "$3" "$4" || status=$?
  if [[ $status = "$1" && ($status = 0 || $(wc -l <"$work/said") = 1 && $(<"$work/said") = *"no NEON"*) ]]; then
    echo "PASS  $2"
  else
    echo "FAIL  $2"
    sed 's/^/      /' "$work/said"
    failed=1
  fi
}
claim 1 "an armhf board without NEON is refused in a line" armhf "Features	: half thumb fastmult vfp edsp vfpv3 vfpv3d16"
claim 1 "an ARMv6 board as well" armhf "Features	: half thumb fastmult vfp edsp java tls"
claim 0 "one with NEON is not" armhf "Features	: half thumb fastmult vfp edsp neon vfpv3 tls vfpv4"
claim 0 "nor a 64-bit processor under a 32-bit system" armhf "Features	: fp asimd evtstrm aes crc32"
claim 0 "nor another architecture" amd64 "flags		: fpu vme"
exit $failed
