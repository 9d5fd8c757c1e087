// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

namespace maplet {

/// Appends little-endian numbers to a buffer. Once something did not fit, it is not ok() and writes
/// nothing more. Memory: a view.
class ByteWriter {
 public:
  explicit ByteWriter(std::span<std::byte> out) noexcept : out_{out} {}

  void bytes(std::span<const std::byte> data) noexcept {
    ok_ = ok_ && data.size() <= out_.size() - at_;
    if (!ok_ || data.empty()) return;
    std::memcpy(out_.data() + at_, data.data(), data.size());
    at_ += data.size();
  }
  /// The low `count` bytes of value, 1..8.
  void fixed(std::uint64_t value, std::size_t count) noexcept {
    std::byte data[8];
    for (std::size_t i = 0; i < count; ++i) data[i] = static_cast<std::byte>(value >> (8 * i));
    bytes({data, count});
  }
  void varint(std::uint64_t value) noexcept {
    for (; value >= 0x80; value >>= 7) fixed(value | 0x80, 1);
    fixed(value, 1);
  }
  /// Small for numbers near zero of either sign.
  void zigzag(std::int64_t value) noexcept {
    varint((static_cast<std::uint64_t>(value) << 1) ^ static_cast<std::uint64_t>(value >> 63));
  }

  /// `count` bytes that somebody else wrote into the rest of the buffer. @pre count <= room()
  void skip(std::size_t count) noexcept { at_ += count; }

  [[nodiscard]] bool ok() const noexcept { return ok_; }
  [[nodiscard]] std::size_t size() const noexcept { return at_; }
  [[nodiscard]] std::size_t room() const noexcept { return out_.size() - at_; }
  /// Takes back everything after `size`, and what went wrong there.
  void rewind(std::size_t size) noexcept {
    at_ = size;
    ok_ = true;
  }

 private:
  std::span<std::byte> out_;
  std::size_t at_ = 0;
  bool ok_ = true;
};

/// Reads what ByteWriter wrote, or anything at all: past the end, or a varint of more than 64 bits,
/// it is not ok() and gives zeros. Memory: a view.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::byte> in) noexcept : in_{in} {}

  [[nodiscard]] std::span<const std::byte> bytes(std::size_t count) noexcept {
    ok_ = ok_ && count <= in_.size() - at_;
    if (!ok_) return {};
    at_ += count;
    return in_.subspan(at_ - count, count);
  }
  [[nodiscard]] std::uint64_t fixed(std::size_t count) noexcept {
    std::uint64_t value = 0;
    const auto data = bytes(count);
    for (std::size_t i = 0; i < data.size(); ++i) value |= std::uint64_t(data[i]) << (8 * i);
    return value;
  }
  [[nodiscard]] std::uint64_t varint() noexcept {
    std::uint64_t value = 0;
    for (int shift = 0; shift < 64; shift += 7) {
      const std::uint64_t byte = fixed(1);
      if (shift == 63 && byte > 1) break;
      value |= (byte & 0x7F) << shift;
      if (byte < 0x80) return ok_ ? value : 0;
    }
    ok_ = false;
    return 0;
  }
  [[nodiscard]] std::int64_t zigzag() noexcept {
    const std::uint64_t value = varint();
    return static_cast<std::int64_t>((value >> 1) ^ (~(value & 1) + 1));
  }
  /// A varint that must be at most `most`.
  [[nodiscard]] std::uint64_t varint_to(std::uint64_t most) noexcept {
    const std::uint64_t value = varint();
    ok_ = ok_ && value <= most;
    return ok_ ? value : 0;
  }

  [[nodiscard]] bool ok() const noexcept { return ok_; }
  [[nodiscard]] std::size_t left() const noexcept { return in_.size() - at_; }

 private:
  std::span<const std::byte> in_;
  std::size_t at_ = 0;
  bool ok_ = true;
};

}  // namespace maplet
