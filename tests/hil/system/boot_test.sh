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
. "$here/guest.sh"

container
for unit in mapletd mapletd@; do
  echo "WatchdogSec=2" >>"$root/etc/systemd/system/$unit.service.d/synth.conf"
done
install_proof proof.sh "$cycles"
boot_container "the journal finds"
