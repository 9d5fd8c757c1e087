// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <unistd.h>

#include "transport/dds/config.hpp"

namespace maplet::test {

/// A domain of this process's own: tests of several trees may run at once.
inline DdsConfig own_domain() {
  DdsConfig config;
  config.domain = 20 + getpid() % 200;
  return config;
}

}  // namespace maplet::test
