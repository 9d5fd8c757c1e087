// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace maplet {

/// One line of the memory ledger.
struct ArenaEntry {
  std::string_view component;  ///< a literal, "stage/what"
  std::size_t count;
  std::size_t bytes;
};

/// All memory of the stages, decided before the first frame.
///
/// Reserves address space, hands it out while the stages are built, and is sealed afterwards: from
/// then on nothing grows. Running out throws ArenaExhausted; asking after the seal terminates.
///
/// Memory   `reserve_bytes` of address space, on 32-bit processors 256 MiB at most; only what is
///          handed out is ever touched.
/// Threads  build on one thread; the storage belongs to whoever asked for it.
class Arena {
 public:
  explicit Arena(std::uint64_t reserve_bytes = std::uint64_t{1} << 32);
  ~Arena();
  Arena(const Arena&) = delete;
  Arena& operator=(const Arena&) = delete;

  /// `count` value-initialised objects. Their destructors never run: trivially destructible only.
  template <class T>
  [[nodiscard]] std::span<T> make_array(std::size_t count, std::string_view component) {
    static_assert(std::is_trivially_destructible_v<T>);
    T* first = static_cast<T*>(take(count * sizeof(T), alignof(T), count, component));
    std::uninitialized_value_construct_n(first, count);
    return {first, count};
  }

  /// One object; the caller's unique_ptr destroys it, the storage stays the arena's.
  template <class T>
  struct Destroy {
    void operator()(T* object) const noexcept { std::destroy_at(object); }
  };
  template <class T>
  using Owned = std::unique_ptr<T, Destroy<T>>;
  template <class T, class... Args>
  [[nodiscard]] Owned<T> make(std::string_view component, Args&&... args) {
    void* place = take(sizeof(T), alignof(T), 1, component);
    return Owned<T>{new (place) T(std::forward<Args>(args)...)};
  }

  /// No more requests; locks the used pages in memory.
  /// @return false when the kernel refused to lock (RLIMIT_MEMLOCK); everything works unlocked.
  [[nodiscard]] bool seal(bool lock) noexcept;

  [[nodiscard]] std::size_t used_bytes() const noexcept { return used_; }
  [[nodiscard]] const std::vector<ArenaEntry>& ledger() const noexcept { return ledger_; }

 private:
  void* take(std::size_t bytes, std::size_t alignment, std::size_t count,
             std::string_view component);

  std::byte* base_;
  std::size_t reserved_;
  std::size_t used_ = 0;
  bool sealed_ = false;
  std::vector<ArenaEntry> ledger_;
};

}  // namespace maplet
