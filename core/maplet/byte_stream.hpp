// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>

namespace maplet {

/// Appends little-endian integers. Never writes past the end; remembers that it would have.
class ByteWriter {
 public:
  explicit ByteWriter(std::span<std::byte> out) noexcept : out_{out} {}

  /// The low `bytes` bytes of `value`.
  void put(std::uint64_t value, int bytes) noexcept {
    for (int i = 0; i < bytes; ++i) push(static_cast<std::byte>(value >> (8 * i)));
  }
  /// A signed number, short when small.
  void put_varint(std::int64_t value) noexcept {
    const auto raw = static_cast<std::uint64_t>(value);
    std::uint64_t zigzag = (raw << 1) ^ (value < 0 ? ~std::uint64_t{0} : 0);
    for (; zigzag >= 0x80; zigzag >>= 7) push(static_cast<std::byte>(zigzag | 0x80));
    push(static_cast<std::byte>(zigzag));
  }
  void push(std::byte byte) noexcept {
    if (size_ < out_.size()) out_[size_] = byte;
    ++size_;
  }
  [[nodiscard]] bool fits() const noexcept { return size_ <= out_.size(); }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }  ///< wanted, written or not

 private:
  std::span<std::byte> out_;
  std::size_t size_ = 0;
};

/// Reads what ByteWriter wrote. Past the end it gives zeros and remembers.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::byte> in) noexcept : in_{in} {}

  [[nodiscard]] std::uint64_t get(int bytes) noexcept {
    std::uint64_t value = 0;
    for (int i = 0; i < bytes; ++i) value |= std::uint64_t{pop()} << (8 * i);
    return value;
  }
  [[nodiscard]] std::int64_t get_signed(int bytes) noexcept {
    const int unused = 64 - 8 * bytes;
    return static_cast<std::int64_t>(get(bytes) << unused) >> unused;
  }
  [[nodiscard]] std::int64_t get_varint() noexcept {
    std::uint64_t zigzag = 0;
    for (int shift = 0; shift < 64; shift += 7) {
      const std::uint8_t byte = pop();
      zigzag |= std::uint64_t{byte & 0x7FU} << shift;
      if ((byte & 0x80U) == 0) break;
    }
    return static_cast<std::int64_t>(zigzag >> 1) ^ -static_cast<std::int64_t>(zigzag & 1U);
  }
  [[nodiscard]] std::uint8_t pop() noexcept {
    if (at_ >= in_.size()) {
      short_ = true;
      return 0;
    }
    return std::to_integer<std::uint8_t>(in_[at_++]);
  }
  [[nodiscard]] bool ran_short() const noexcept { return short_; }
  [[nodiscard]] std::span<const std::byte> rest() const noexcept { return in_.subspan(at_); }

 private:
  std::span<const std::byte> in_;
  std::size_t at_ = 0;
  bool short_ = false;
};

}  // namespace maplet
