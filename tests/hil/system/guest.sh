# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
# What the systems of boot_test.sh and qemu_test.sh have in common; sourced after debian_root.sh.
# Needs build, synth, here, work, root.

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
