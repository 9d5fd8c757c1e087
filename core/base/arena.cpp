// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/base/arena.hpp"

#include <sys/mman.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "core/base/arena_exhausted.hpp"

namespace maplet {

namespace {

// A 32-bit process has 2 to 4 GiB in all, and more than one arena.
constexpr std::uint64_t kMostReserved =
    sizeof(void*) == 8 ? std::uint64_t{1} << 47 : std::uint64_t{1} << 28;

[[noreturn]] void die(const char* what, std::string_view component) noexcept {
  std::fprintf(stderr, "mapletd: bug: %s (arena, component %.*s)\n", what,
               static_cast<int>(component.size()), component.data());
  std::abort();
}

}  // namespace

Arena::Arena(std::uint64_t reserve_bytes)
    : base_{nullptr}, reserved_{static_cast<std::size_t>(std::min(reserve_bytes, kMostReserved))} {
  void* block = mmap(nullptr, reserved_, PROT_READ | PROT_WRITE,
                     MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (block == MAP_FAILED) throw std::bad_alloc{};
  base_ = static_cast<std::byte*>(block);
}

Arena::~Arena() { munmap(base_, reserved_); }

void* Arena::take(std::size_t bytes, std::size_t alignment, std::size_t count,
                  std::string_view component) {
  if (sealed_) die("storage asked for after start-up", component);
  const std::size_t start = (used_ + alignment - 1) / alignment * alignment;
  if (bytes > reserved_ || start > reserved_ - bytes) {
    throw ArenaExhausted{"more than " + std::to_string(reserved_ >> 20) + " MiB, with " +
                         std::string{component}};
  }
  used_ = start + bytes;
  ledger_.push_back({component, count, bytes});
  return base_ + start;
}

bool Arena::seal(bool lock) noexcept {
  sealed_ = true;
  return !lock || used_ == 0 || mlock(base_, used_) == 0;
}

}  // namespace maplet
