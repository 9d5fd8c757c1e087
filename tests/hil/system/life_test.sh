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

container
cp "$work"/package/mapletd_*.deb "$root/mapletd.deb"
next_version "$root/mapletd.deb" "$work/next" "$root/next.deb"
install_proof life.sh
boot_container "nothing is left"
