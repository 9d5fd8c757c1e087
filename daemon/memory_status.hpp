// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "core/base/arena.hpp"

namespace maplet::daemon {

/// Resident memory of this process, now and at its most.
[[nodiscard]] std::size_t rss_bytes() noexcept;
[[nodiscard]] std::size_t peak_rss_bytes() noexcept;

/// The least memory limit of the control groups that this process is in; nothing when there is
/// none.
[[nodiscard]] std::optional<std::uint64_t> cgroup_memory_limit();

/// What the daemon may take, and what it took.
///
/// Threads  any, after the arena is sealed.
class MemoryStatus {
 public:
  MemoryStatus(const Arena& arena, bool locked) : arena_{arena}, locked_{locked} {}

  [[nodiscard]] const Arena& arena() const noexcept { return arena_; }
  [[nodiscard]] bool locked() const noexcept { return locked_; }
  [[nodiscard]] std::optional<std::uint64_t> limit_bytes() const noexcept { return limit_bytes_; }

 private:
  const Arena& arena_;
  bool locked_;
  std::optional<std::uint64_t> limit_bytes_ = cgroup_memory_limit();
};

}  // namespace maplet::daemon
