// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace maplet::daemon {

/// Counts what malloc, new and their kin are asked for after READY: the proof of "no allocation on
/// our threads". Replaces malloc for the whole process by thin wrappers around the C library's.
///
/// Threads that never call watch_this_thread() are third-party ones. Inside a ThirdPartyScope our
/// own thread's requests count as theirs: decoding a source, handing a sample to DDS.
///
/// Memory  none. Threads  any. Where the wrappers are not linked (tests, sanitizers) nothing is
/// counted: allocation_counting_available() is false.
struct AllocationCounts {
  std::uint64_t ours = 0;
  std::uint64_t third_party = 0;
};

[[nodiscard]] bool allocation_counting_available() noexcept;
/// What the wrappers call: that they are there, and for each request.
void allocations_are_counted() noexcept;
void count_allocation() noexcept;
void watch_this_thread() noexcept;
/// From here on requests count. Called at READY.
void start_counting_allocations() noexcept;
void stop_counting_allocations() noexcept;
[[nodiscard]] AllocationCounts allocation_counts() noexcept;

class ThirdPartyScope {
 public:
  ThirdPartyScope() noexcept;
  ~ThirdPartyScope();
  ThirdPartyScope(const ThirdPartyScope&) = delete;
  ThirdPartyScope& operator=(const ThirdPartyScope&) = delete;

 private:
  bool before_;
};

}  // namespace maplet::daemon
