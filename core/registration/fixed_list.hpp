// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace maplet {

/// A vector of fixed capacity that an arena's array may hold: nothing to destroy.
template <class T, std::size_t N>
class FixedList {
 public:
  void push_back(const T& item) noexcept { items_[count_++] = item; }
  void clear() noexcept { count_ = 0; }
  [[nodiscard]] bool full() const noexcept { return count_ == N; }
  [[nodiscard]] bool empty() const noexcept { return count_ == 0; }
  [[nodiscard]] std::size_t size() const noexcept { return count_; }
  [[nodiscard]] const T& operator[](std::size_t i) const noexcept { return items_[i]; }
  [[nodiscard]] const T& back() const noexcept { return items_[count_ - 1U]; }
  [[nodiscard]] const T* begin() const noexcept { return items_.data(); }
  [[nodiscard]] const T* end() const noexcept { return items_.data() + count_; }

 private:
  std::array<T, N> items_;
  std::uint32_t count_ = 0;
};

}  // namespace maplet
