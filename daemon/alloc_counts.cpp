// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <atomic>
#include <cstdlib>

#include "daemon/alloc_counter.hpp"

namespace maplet::daemon {

namespace {

std::atomic<bool> available{false};
std::atomic<bool> counting{false};
std::atomic<std::uint64_t> ours{0};
std::atomic<std::uint64_t> third_party{0};
thread_local bool watched = false;

}  // namespace

void count_allocation() noexcept {
  if (!counting.load(std::memory_order_relaxed)) return;
  (watched ? ours : third_party).fetch_add(1, std::memory_order_relaxed);
  // MAPLETD_ABORT_ON_ALLOCATION=1: a debugger then shows who asked.
  static const bool abort_on_ours = std::getenv("MAPLETD_ABORT_ON_ALLOCATION") != nullptr;
  if (watched && abort_on_ours) std::abort();
}

void allocations_are_counted() noexcept { available = true; }
bool allocation_counting_available() noexcept { return available; }
void watch_this_thread() noexcept { watched = true; }
void start_counting_allocations() noexcept { counting = true; }
void stop_counting_allocations() noexcept { counting = false; }
AllocationCounts allocation_counts() noexcept { return {ours, third_party}; }

ThirdPartyScope::ThirdPartyScope() noexcept : before_{watched} { watched = false; }
ThirdPartyScope::~ThirdPartyScope() { watched = before_; }

}  // namespace maplet::daemon
