#!/bin/bash
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
# Boots a small Debian 12 with systemd in a container, the package installed inside and the synthetic
# camera behind the real OpenNI2 runtime, and looks at the service there (proof.sh).
#   boot_test.sh BUILD_DIR SYNTH_RUNTIME [CYCLES]
# As root. Needs mmdebstrap and systemd-container (tools/setup system); minutes and the network.
set -eu
build=$1 synth=$2 cycles=${3:-10}
here=$(cd "$(dirname "$0")" && pwd)
. "$here/../../support/debian_root.sh"
needs mmdebstrap systemd-nspawn

# The packages that hold the libraries that the programs load.
libraries() {
  ldd "$build/bin/mapletd" "$build/bin/mapletctl" "$synth"/OpenNI2/Drivers/libMapletSynth.so.0 |
    awk '$2 == "=>" && $3 ~ "^/" { print $3 }' | xargs -n1 readlink -f | sort -u |
    sed 's,^/usr,,; p; s,^,/usr,' | xargs -n1 dpkg-query -S 2>/dev/null | cut -d: -f1 | sort -u
}

work=$(mktemp -d "${TMPDIR:-/var/tmp}/mapletd-boot.XXXXXX")
trap 'rm -rf --one-file-system "$work"' EXIT
root=$work/root
debian_root boot "$(libraries | paste -sd,),systemd,systemd-sysv,dbus,udev,jq,procps" "$root"

(cd "$build" && cpack -B "$work/package" >"$work/cpack.log" 2>&1) || { cat "$work/cpack.log"; exit 1; }
cp "$work"/package/mapletd_*.deb "$root/mapletd.deb"
chroot "$root" dpkg -i /mapletd.deb >"$work/dpkg.log" 2>&1 || { cat "$work/dpkg.log"; exit 1; }
mkdir -p "$root/opt/proof" "$root/opt/synth/OpenNI2/Drivers"
runtime=$(readlink -f "$synth/libOpenNI2.so.0")
ln -s "$runtime" "$root/opt/synth/libOpenNI2.so.0"
cp "$synth/OpenNI2/Drivers/libMapletSynth.so.0" "$root/opt/synth/OpenNI2/Drivers/"
install -m 755 "$here/proof.sh" "$root/opt/proof/"
cp "$root/etc/mapletd/mapletd.toml" "$root/etc/mapletd/agent-2.toml"
for unit in mapletd mapletd@; do
  mkdir -p "$root/etc/systemd/system/$unit.service.d"
  cat >"$root/etc/systemd/system/$unit.service.d/synth.conf" <<EOF
[Service]
Environment=LD_LIBRARY_PATH=/opt/synth
Environment="MAPLET_SYNTH=world=room sim.seed=3 sim.frames=1000000 rate_hz=15"
WatchdogSec=2
EOF
done
cat >"$root/etc/systemd/system/proof.service" <<EOF
[Unit]
After=mapletd.service
[Service]
Type=oneshot
TimeoutStartSec=300
ExecStart=/opt/proof/proof.sh $cycles
[Install]
WantedBy=multi-user.target
EOF
systemctl --root="$root" --quiet enable mapletd proof
systemctl --root="$root" --quiet mask systemd-networkd-wait-online.service

timeout 400 systemd-nspawn --quiet --directory="$root" --register=no --keep-unit --boot \
  </dev/null >"$work/console" 2>&1 || true
if [[ ! -f $root/opt/proof/result ]]; then
  tail -40 "$work/console"
  echo "FAIL  it did not boot"
  exit 1
fi
cat "$root/opt/proof/result"
! grep -q '^FAIL' "$root/opt/proof/result" && grep -q '^PASS  a second agent' "$root/opt/proof/result"
