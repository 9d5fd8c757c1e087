// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "core/base/field.hpp"

namespace maplet::daemon {

/// The flight recorder. Section [recorder].
struct RecorderConfig {
  std::string file;
  int size_mib = 256;
  int queue_kib = 4096;

  static constexpr Field<RecorderConfig> kFields[] = {
      {"file", &RecorderConfig::file, 0, 0,
       "Where what reaches the estimator is recorded, round and round; empty = nowhere. Wears "
       "flash: "
       "docs/journal.md"},
      {"size_mib", &RecorderConfig::size_mib, 1, 65536,
       "Of that file at most; then the oldest goes"},
      {"queue_kib", &RecorderConfig::queue_kib, 256, 262144,
       "What may wait for its disk; when it is full the recording ends there"},
  };
};

}  // namespace maplet::daemon
