// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace maplet::sim {

/// A 64-bit mix (splitmix64's finaliser): every input bit reaches every output bit. Counter-based
/// randomness: the value belongs to its key, so frames can be made in any order.
[[nodiscard]] constexpr std::uint64_t mix(std::uint64_t x) noexcept {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}
[[nodiscard]] constexpr std::uint64_t mix(std::uint64_t a, std::uint64_t b) noexcept {
  return mix(mix(a + 0x9e3779b97f4a7c15ULL) ^ (b * 0xd1342543de82ef95ULL + 0x2545f4914f6cdd1dULL));
}

/// A sequence of draws from one seed; own distributions, so every standard library draws the same.
/// Two draws never stand among the arguments of one call: processors' compilers evaluate those in
/// different orders, and the worlds would differ.
class Random {
 public:
  Random(std::uint64_t seed, std::uint64_t stream) noexcept : key_{mix(seed, stream)} {}

  [[nodiscard]] std::uint64_t bits() noexcept { return mix(key_, count_++); }
  /// In [low, high).
  [[nodiscard]] double uniform(double low, double high) noexcept {
    return low + (high - low) * static_cast<double>(bits() >> 11) * 0x1p-53;
  }
  /// In [-half, half).
  [[nodiscard]] double spread(double half) noexcept { return uniform(-half, half); }
  /// In [0, count).
  [[nodiscard]] int index(int count) noexcept {
    return static_cast<int>(uniform(0.0, static_cast<double>(count)));
  }
  [[nodiscard]] bool chance(double probability) noexcept { return uniform(0, 1) < probability; }

 private:
  std::uint64_t key_;
  std::uint64_t count_ = 0;
};

}  // namespace maplet::sim
