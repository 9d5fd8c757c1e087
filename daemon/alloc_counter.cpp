// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Linked into the program itself, not into the library: stands before libc's malloc.
#ifndef MAPLET_SANITIZED

#include "daemon/alloc_counter.hpp"

#include <cerrno>
#include <cstddef>

// glibc lets a program define these; new and delete go through them.
extern "C" {

void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);

void* malloc(std::size_t bytes) {
  maplet::daemon::count_allocation();
  return __libc_malloc(bytes);
}
void* calloc(std::size_t count, std::size_t bytes) {
  maplet::daemon::count_allocation();
  return __libc_calloc(count, bytes);
}
void* realloc(void* block, std::size_t bytes) {
  maplet::daemon::count_allocation();
  return __libc_realloc(block, bytes);
}
void* memalign(std::size_t alignment, std::size_t bytes) {
  maplet::daemon::count_allocation();
  return __libc_memalign(alignment, bytes);
}
void* aligned_alloc(std::size_t alignment, std::size_t bytes) {
  maplet::daemon::count_allocation();
  return __libc_memalign(alignment, bytes);
}
int posix_memalign(void** block, std::size_t alignment, std::size_t bytes) {
  maplet::daemon::count_allocation();
  *block = __libc_memalign(alignment, bytes);
  return *block == nullptr ? ENOMEM : 0;
}

}  // extern "C"

namespace {
[[maybe_unused]] const bool counted = (maplet::daemon::allocations_are_counted(), true);
}

#endif
