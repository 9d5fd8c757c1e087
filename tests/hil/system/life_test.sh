#!/bin/bash
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
# Boots a small Debian 12 with systemd in a container and takes the package through its life there (life.sh).
#   life_test.sh BUILD_DIR SYNTH_RUNTIME
# As root. Needs mmdebstrap and systemd-container (tools/setup system); minutes and the network.
set -eu
build=$1 synth=$2
here=$(cd "$(dirname "$0")" && pwd)
. "$here/../../support/debian_root.sh"
. "$here/guest.sh"
needs mmdebstrap systemd-nspawn

work=$(mktemp -d "${TMPDIR:-/var/tmp}/mapletd-boot.XXXXXX")
trap 'rm -rf --one-file-system "$work"' EXIT
root=$work/root
debian_root boot "$(libraries | paste -sd,),systemd,systemd-sysv,dbus,udev,jq,procps" "$root"
install_package
cp "$work"/package/mapletd_*.deb "$root/mapletd.deb"
next_version "$root/mapletd.deb" "$work/next" "$root/next.deb"
install_camera "world=room sim.seed=3 sim.frames=1000000 rate_hz=15" mapletd mapletd@
cp "$root/etc/mapletd/mapletd.toml" "$root/etc/mapletd/agent-2.toml"
install_proof life.sh

timeout 500 systemd-nspawn --quiet --directory="$root" --register=no --keep-unit --boot \
  </dev/null >"$work/console" 2>&1 || true
if [[ ! -f $root/opt/proof/result ]]; then
  tail -40 "$work/console"
  echo "FAIL  it did not boot"
  exit 1
fi
cat "$root/opt/proof/result"
! grep -q '^FAIL' "$root/opt/proof/result" && grep -q '^PASS  nothing is left' "$root/opt/proof/result"
