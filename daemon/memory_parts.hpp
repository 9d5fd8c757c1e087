// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

namespace maplet::daemon {

/// What of the daemon takes memory beside the estimator.
struct MemoryParts {
  bool dds = true;
  bool journal = false;
};

}  // namespace maplet::daemon
