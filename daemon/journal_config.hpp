// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "core/base/field.hpp"

namespace maplet::daemon {

/// The mission on disk. Section [journal]; where it lies says --state.
struct JournalConfig {
  int size_mib = 64;
  int queue_kib = 256;

  [[nodiscard]] std::size_t queue_bytes() const noexcept {
    return static_cast<std::size_t>(queue_kib) * 1024;
  }

  static constexpr Field<JournalConfig> kFields[] = {
      {"size_mib", &JournalConfig::size_mib, 4, 4096,
       "Size of the journal's file, taken at once when a mission begins; see docs/journal.md"},
      {"queue_kib", &JournalConfig::queue_kib, 64, 65536,
       "What may wait for the disk; when it is full the mission goes on in memory"},
  };
};

}  // namespace maplet::daemon
