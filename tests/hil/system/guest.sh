# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
# What the systems of boot_test.sh, life_test.sh and qemu_test.sh have in common; sourced after debian_root.sh.
# Needs build, synth, here; a container's functions make work and root, qemu_test.sh does so itself.

# The packages that hold the libraries that the programs load.
libraries() {
  ldd "$build/bin/mapletd" "$build/bin/mapletctl" "$synth"/OpenNI2/Drivers/libMapletSynth.so.0 |
    awk '$2 == "=>" && $3 ~ "^/" { print $3 }' | xargs -n1 readlink -f | sort -u |
    sed 's,^/usr,,; p; s,^,/usr,' | xargs -n1 dpkg-query -S 2>/dev/null | cut -d: -f1 | sort -u
}

install_package() { # into the root, as a user does
  (cd "$build" && cpack -B "$work/package" >"$work/cpack.log" 2>&1) || { cat "$work/cpack.log"; exit 1; }
  cp "$work"/package/mapletd_*.deb "$root/mapletd.deb"
  chroot "$root" dpkg -i /mapletd.deb >"$work/dpkg.log" 2>&1 || { cat "$work/dpkg.log"; exit 1; }
  rm "$root/mapletd.deb"
}

install_camera() { # SCRIPT(MAPLET_SYNTH) UNITS... : the synthetic camera behind the real runtime, for these units
  local script=$1 unit
  shift
  mkdir -p "$root/opt/synth/OpenNI2/Drivers"
  ln -s "$(readlink -f "$synth/libOpenNI2.so.0")" "$root/opt/synth/libOpenNI2.so.0"
  cp "$synth/OpenNI2/Drivers/libMapletSynth.so.0" "$root/opt/synth/OpenNI2/Drivers/"
  for unit; do
    mkdir -p "$root/etc/systemd/system/$unit.service.d"
    cat >"$root/etc/systemd/system/$unit.service.d/synth.conf" <<EOF
[Service]
Environment=LD_LIBRARY_PATH=/opt/synth
Environment="MAPLET_SYNTH=$script"
EOF
  done
}

install_proof() { # SCRIPT ARGUMENTS... : runs once the service has started, writes /opt/proof/result
  local script=$1
  shift
  mkdir -p "$root/opt/proof"
  install -m 755 "$here/$script" "$root/opt/proof/"
  cp "$here/claims.sh" "$root/opt/proof/"
  cat >"$root/etc/systemd/system/proof.service" <<EOF
[Unit]
After=mapletd.service
[Service]
Type=oneshot
TimeoutStartSec=900
ExecStart=/opt/proof/$script $*
[Install]
WantedBy=multi-user.target
EOF
  systemctl --root="$root" --quiet enable mapletd proof
  systemctl --root="$root" --quiet mask systemd-networkd-wait-online.service
}

# A small Debian with systemd, the package installed and enabled, two agents configured, the camera behind both.
container() {
  needs mmdebstrap systemd-nspawn
  work=$(mktemp -d "${TMPDIR:-/var/tmp}/mapletd-boot.XXXXXX")
  trap 'rm -rf --one-file-system "$work"' EXIT
  root=$work/root
  debian_root boot "$(libraries | paste -sd,),systemd,systemd-sysv,dbus,udev,jq,procps" "$root"
  install_package
  install_camera "world=room sim.seed=3 sim.frames=1000000 rate_hz=15" mapletd mapletd@
  cp "$root/etc/mapletd/mapletd.toml" "$root/etc/mapletd/agent-2.toml"
}

boot_container() { # LAST_CLAIM: until it goes off; its result is ours
  timeout 1200 systemd-nspawn --quiet --directory="$root" --register=no --keep-unit --boot \
    </dev/null >"$work/console" 2>&1 || true
  if [[ ! -f $root/opt/proof/result ]]; then
    tail -40 "$work/console"
    echo "FAIL  it did not boot"
    return 1
  fi
  cat "$root/opt/proof/result"
  ! grep -q '^FAIL' "$root/opt/proof/result" && grep -q "^PASS  $1" "$root/opt/proof/result"
}
