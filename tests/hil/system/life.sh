#!/bin/bash
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
# Inside the booted system (life_test.sh): the package is upgraded over an edited configuration while two agents
# run, removed, installed and enabled again, and purged; then the machine goes off.
. /opt/proof/claims.sh
ctl() { mapletctl "$@" --agent 0; } # of two
status() { ctl status --json; }
maplets() { ctl maplets --json | jq length; }

soon 90 running && systemctl enable --quiet --now mapletd@2 && soon 90 mapletctl status --agent 2
held=$?
claim $held "installed and enabled, two agents run"
[[ $held = 0 ]] || give_up
soon 240 safe 1
held=$?
claim $held "there is a map to lose: $(maplets) maplets"
[[ $held = 0 ]] || journalctl -u mapletd --no-pager -o cat | tail -20
echo "# mine" >>/etc/mapletd/mapletd.toml
before=$(show MainPID)
dpkg --force-confdef --force-confold -i /next.deb >/opt/proof/dpkg 2>&1 &&
  soon 90 bash -c "[[ \$(systemctl show mapletd -P MainPID) != $before ]]" && soon 90 running && soon 90 mapletctl status --agent 2
held=$?
claim $held "an upgrade restarts both agents: $(dpkg-query -W -f '${Version}' mapletd)"
grep -qx "# mine" /etc/mapletd/mapletd.toml
held=$?
claim $held "an edited configuration stays"

dpkg -r mapletd >/opt/proof/dpkg 2>&1 && ! systemctl -q is-active mapletd && ! systemctl -q is-active mapletd@2 && ! pidof mapletd
held=$?
claim $held "removal stops them"
[[ ! -e /usr/bin/mapletd && -n $(find /var/lib/mapletd -type f -size +0) && -f /etc/mapletd/mapletd.toml ]]
held=$?
claim $held "the state and the configuration stay: $(find /var/lib/mapletd -type f | wc -l) files"
[[ -z $(find /etc/systemd/system -type l -name 'mapletd*') ]]
held=$?
claim $held "nothing is enabled any more"

dpkg --force-confdef --force-confold -i /mapletd.deb >/opt/proof/dpkg 2>&1 && systemctl enable --quiet --now mapletd && soon 90 running
held=$?
claim $held "installed and enabled, it is ready at once"
dpkg -P mapletd >/opt/proof/dpkg 2>&1 && ! pidof mapletd
held=$?
claim $held "purged while it runs"
left=$(find / -xdev \( -name '*mapletd*' -o -name '*mapletctl*' \) -not -path '/proc/*' -not -path '/etc/systemd/system/mapletd*.service.d*' \
  -not -path '/mapletd.deb' -not -path '/tmp/systemd-private-*' -not -path '/var/tmp/systemd-private-*' -not -path '/sys/*')
! getent passwd mapletd >/dev/null && [[ -z $left ]]
held=$?
claim $held "nothing is left: $left"
systemctl poweroff
