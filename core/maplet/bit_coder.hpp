// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/maplet/byte_stream.hpp"

namespace maplet {

/// How likely a bit is 0, learnt while coding. 12 bits, exact integers: the same everywhere.
class BitModel {
 public:
  static constexpr int kBits = 12;

  [[nodiscard]] std::uint32_t zero() const noexcept { return zero_; }
  void learn(bool bit) noexcept {
    // Fast at first, steady later: a maplet has few cells to learn from.
    const int shift = seen_ < 4 ? 2 : seen_ < 16 ? 3 : 4;
    if (seen_ < 16) ++seen_;
    if (bit) {
      zero_ = static_cast<std::uint16_t>(zero_ - (zero_ >> shift));
    } else {
      zero_ = static_cast<std::uint16_t>(zero_ + (((1U << kBits) - zero_) >> shift));
    }
    if (zero_ < kFloor) zero_ = kFloor;
    if (zero_ > (1U << kBits) - kFloor) zero_ = (1U << kBits) - kFloor;
  }

 private:
  static constexpr std::uint16_t kFloor = 24;
  std::uint16_t zero_ = 1U << (kBits - 1);
  std::uint8_t seen_ = 0;
};

/// Binary range encoder (Martin 1979, with carry propagation as in LZMA).
class BitEncoder {
 public:
  explicit BitEncoder(ByteWriter& out) noexcept : out_{out} {}

  void put(bool bit, BitModel& model) noexcept {
    const std::uint32_t bound = (range_ >> BitModel::kBits) * model.zero();
    if (bit) {
      low_ += bound;
      range_ -= bound;
    } else {
      range_ = bound;
    }
    model.learn(bit);
    while (range_ < (1U << 24)) {
      range_ <<= 8;
      shift_low();
    }
  }
  /// Once, after the last bit.
  void finish() noexcept {
    for (int i = 0; i < 5; ++i) shift_low();
  }

 private:
  void shift_low() noexcept {
    if (low_ < 0xFF000000U || low_ > 0xFFFFFFFFU) {
      const auto carry = static_cast<std::uint8_t>(low_ >> 32);
      if (started_) out_.push(static_cast<std::byte>(held_ + carry));
      for (; pending_ > 0; --pending_) out_.push(static_cast<std::byte>(0xFF + carry));
      started_ = true;
      held_ = static_cast<std::uint8_t>(low_ >> 24);
    } else {
      ++pending_;
    }
    low_ = (low_ & 0x00FFFFFFU) << 8;
  }

  ByteWriter& out_;
  std::uint64_t low_ = 0;
  std::uint32_t range_ = 0xFFFFFFFFU;
  std::uint32_t pending_ = 0;
  std::uint8_t held_ = 0;
  bool started_ = false;
};

/// Reads what BitEncoder wrote; on anything else it gives some bits and stays in bounds.
class BitDecoder {
 public:
  explicit BitDecoder(ByteReader& in) noexcept : in_{in} {
    for (int i = 0; i < 4; ++i) code_ = (code_ << 8) | in_.pop();
  }
  [[nodiscard]] bool get(BitModel& model) noexcept {
    const std::uint32_t bound = (range_ >> BitModel::kBits) * model.zero();
    const bool bit = code_ >= bound;
    if (bit) {
      code_ -= bound;
      range_ -= bound;
    } else {
      range_ = bound;
    }
    model.learn(bit);
    while (range_ < (1U << 24)) {
      range_ <<= 8;
      code_ = (code_ << 8) | in_.pop();
    }
    return bit;
  }

 private:
  ByteReader& in_;
  std::uint32_t code_ = 0;
  std::uint32_t range_ = 0xFFFFFFFFU;
};

}  // namespace maplet
