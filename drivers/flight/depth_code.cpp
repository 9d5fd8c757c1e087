// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/flight/depth_code.hpp"

#include <algorithm>

namespace maplet::flight {

namespace {

/// Four bits at a time, three of the number each.
class Nibbles {
 public:
  explicit Nibbles(std::vector<std::byte>& out) : out_{out} {}
  void put(std::uint32_t value) {
    do {
      std::uint32_t nibble = value & 7U;
      value >>= 3;
      if (value != 0) nibble |= 8U;
      push(nibble);
    } while (value != 0);
  }

 private:
  void push(std::uint32_t nibble) {
    if (half_) {
      out_.back() |= static_cast<std::byte>(nibble << 4);
    } else {
      out_.push_back(static_cast<std::byte>(nibble));
    }
    half_ = !half_;
  }
  std::vector<std::byte>& out_;
  bool half_ = false;
};

class NibbleReader {
 public:
  explicit NibbleReader(std::span<const std::byte> in) noexcept : in_{in} {}
  [[nodiscard]] bool get(std::uint32_t& value) noexcept {
    value = 0;
    for (int shift = 0; shift < 30; shift += 3) {
      if (at_ >= 2 * in_.size()) return false;
      const auto octet = std::to_integer<std::uint32_t>(in_[at_ / 2]);
      const std::uint32_t nibble = at_ % 2 == 0 ? octet & 15U : octet >> 4;
      ++at_;
      value |= (nibble & 7U) << shift;
      if ((nibble & 8U) == 0) return true;
    }
    return false;
  }

 private:
  std::span<const std::byte> in_;
  std::size_t at_ = 0;
};

}  // namespace

void encode_depth(std::span<const std::uint16_t> pixels, std::vector<std::byte>& out) {
  out.clear();
  Nibbles nibbles{out};
  std::int32_t before = 0;
  for (std::size_t i = 0; i < pixels.size();) {
    const std::size_t zeros_from = i;
    while (i < pixels.size() && pixels[i] == 0) ++i;
    nibbles.put(static_cast<std::uint32_t>(i - zeros_from));
    const std::size_t from = i;
    while (i < pixels.size() && pixels[i] != 0) ++i;
    nibbles.put(static_cast<std::uint32_t>(i - from));
    for (std::size_t k = from; k < i; ++k) {
      const std::int32_t step = pixels[k] - before;
      nibbles.put((static_cast<std::uint32_t>(step) << 1) ^ static_cast<std::uint32_t>(step >> 31));
      before = pixels[k];
    }
  }
}

bool decode_depth(std::span<const std::byte> bytes, std::span<std::uint16_t> out) noexcept {
  NibbleReader in{bytes};
  std::int32_t before = 0;
  for (std::size_t i = 0; i < out.size();) {
    std::uint32_t zeros = 0;
    std::uint32_t others = 0;
    if (!in.get(zeros) || zeros > out.size() - i) return false;
    std::fill_n(out.begin() + static_cast<std::ptrdiff_t>(i), zeros, std::uint16_t{0});
    i += zeros;
    if (!in.get(others) || others > out.size() - i || zeros + others == 0) return false;
    for (const std::size_t end = i + others; i < end; ++i) {
      std::uint32_t code = 0;
      if (!in.get(code)) return false;
      before += static_cast<std::int32_t>((code >> 1) ^ (~(code & 1U) + 1U));
      if (before < 0 || before > 0xFFFF) return false;
      out[i] = static_cast<std::uint16_t>(before);
    }
  }
  return true;
}

}  // namespace maplet::flight
