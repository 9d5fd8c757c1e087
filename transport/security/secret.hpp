// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <span>

namespace maplet {

/// Fills memory with zeros, whatever a compiler thinks of it.
void wipe(std::span<std::byte> bytes) noexcept;

/// Bytes that nobody else may see: gone when it goes. Copies are as secret. Memory: inside.
template <std::size_t N>
class Secret {
 public:
  Secret() noexcept = default;
  Secret(const Secret&) noexcept = default;
  Secret& operator=(const Secret&) noexcept = default;
  ~Secret() { wipe(bytes_); }

  [[nodiscard]] std::span<std::byte, N> bytes() noexcept { return bytes_; }
  [[nodiscard]] std::span<const std::byte, N> bytes() const noexcept { return bytes_; }

  friend bool operator==(const Secret&, const Secret&) = default;

 private:
  std::array<std::byte, N> bytes_{};
};

}  // namespace maplet
