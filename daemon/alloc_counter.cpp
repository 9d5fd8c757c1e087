// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/alloc_counter.hpp"

#include <atomic>
#include <cerrno>
#include <cstddef>
#include <cstdlib>

namespace maplet::daemon {

namespace {

std::atomic<bool> counting{false};
std::atomic<std::uint64_t> ours{0};
std::atomic<std::uint64_t> third_party{0};
thread_local bool watched = false;

[[maybe_unused]] void count() noexcept {
  if (!counting.load(std::memory_order_relaxed)) return;
  (watched ? ours : third_party).fetch_add(1, std::memory_order_relaxed);
  // MAPLETD_ABORT_ON_ALLOCATION=1: a debugger then shows who asked.
  static const bool abort_on_ours = std::getenv("MAPLETD_ABORT_ON_ALLOCATION") != nullptr;
  if (watched && abort_on_ours) std::abort();
}

}  // namespace

void watch_this_thread() noexcept { watched = true; }
void start_counting_allocations() noexcept { counting = true; }
void stop_counting_allocations() noexcept { counting = false; }
AllocationCounts allocation_counts() noexcept { return {ours, third_party}; }

ThirdPartyScope::ThirdPartyScope() noexcept : before_{watched} { watched = false; }
ThirdPartyScope::~ThirdPartyScope() { watched = before_; }

}  // namespace maplet::daemon

#ifdef MAPLET_SANITIZED

bool maplet::daemon::allocation_counting_available() noexcept { return false; }

#else

bool maplet::daemon::allocation_counting_available() noexcept { return true; }

// glibc lets a program define these; new and delete go through them.
extern "C" {

void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);

void* malloc(std::size_t bytes) {
  maplet::daemon::count();
  return __libc_malloc(bytes);
}
void* calloc(std::size_t count, std::size_t bytes) {
  maplet::daemon::count();
  return __libc_calloc(count, bytes);
}
void* realloc(void* block, std::size_t bytes) {
  maplet::daemon::count();
  return __libc_realloc(block, bytes);
}
void* memalign(std::size_t alignment, std::size_t bytes) {
  maplet::daemon::count();
  return __libc_memalign(alignment, bytes);
}
void* aligned_alloc(std::size_t alignment, std::size_t bytes) {
  maplet::daemon::count();
  return __libc_memalign(alignment, bytes);
}
int posix_memalign(void** block, std::size_t alignment, std::size_t bytes) {
  maplet::daemon::count();
  *block = __libc_memalign(alignment, bytes);
  return *block == nullptr ? ENOMEM : 0;
}

}  // extern "C"

#endif
