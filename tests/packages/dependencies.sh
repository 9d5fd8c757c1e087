#!/bin/bash
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
# What is installed with the package into a bare Debian, with sizes: each dependency alone, then all of
# them with what they need themselves, but for what every Debian has.
#   dependencies.sh ROOT DEPENDS(comma separated names)
set -eu
dpkg-query --admindir="$1/var/lib/dpkg" -W \
  -f '${db:Status-Status}|${Package}|${Essential}|${Priority}|${Installed-Size}|${Pre-Depends}, ${Depends}|${Provides}\n' |
  awk -F '|' -v wanted="$2" '
    function bare(text) { gsub(/\([^)]*\)|:[a-z]+| /, "", text); return text }
    $1 == "installed" {
      size[$2] = $5; always[$2] = $3 == "yes" || $4 == "required"; needs[$2] = $6
      n = split($NF, other, ",")
      for (i = 1; i <= n; ++i) real[bare(other[i])] = $2  # a name that this package goes by as well
    }
    function found(name) { return name in size || !(name in real) ? name : real[name] }
    function take(name,   all, n, i) {
      name = found(name)
      if (!(name in size) || name in taken) return
      taken[name] = 1
      n = split(needs[name], all, /[,|]/)
      for (i = 1; i <= n; ++i) take(bare(all[i]))
    }
    END {
      n = split(wanted, direct, ",")
      for (i = 1; i <= n; ++i) {
        direct[i] = found(direct[i])
        if (!(direct[i] in size)) { print "not installed: " direct[i]; exit 1 }
        printf "  %-26s %6d KiB\n", direct[i], size[direct[i]]
      }
      take("libc6")  # and what it needs: every Debian has it
      for (name in taken) always[name] = 1
      for (i = 1; i <= n; ++i) take(direct[i])
      for (name in taken) if (!always[name]) { sum += size[name]; ++count }
      printf "  %d packages in all           %6d KiB\n", count, sum
    }'
