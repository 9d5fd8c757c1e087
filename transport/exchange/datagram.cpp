// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/exchange/datagram.hpp"

#include "core/base/crc.hpp"

namespace maplet {

namespace {

constexpr std::uint64_t kMagic = 0xA0;

std::span<std::byte> without_crc(std::span<std::byte> out) noexcept {
  return out.first(out.size() < kDatagramCrcBytes ? 0 : out.size() - kDatagramCrcBytes);
}

std::span<const std::byte> entries_of(std::span<const std::byte> bytes) noexcept {
  if (bytes.size() < kDatagramHeadBytes + kDatagramCrcBytes) return {};
  return bytes.subspan(kDatagramHeadBytes, bytes.size() - kDatagramHeadBytes - kDatagramCrcBytes);
}

}  // namespace

DatagramWriter::DatagramWriter(std::span<std::byte> out, const DatagramHead& head) noexcept
    : out_{out}, writer_{without_crc(out)} {
  writer_.fixed(kMagic | kDatagramVersion, 1);
  writer_.fixed(head.sender.agent, 2);
  writer_.fixed(head.sender.epoch, 4);
  writer_.fixed(head.count, 2);
}

bool DatagramWriter::add(EntryKind kind, std::span<const std::byte> body) noexcept {
  const std::size_t start = writer_.size();
  writer_.fixed(static_cast<std::uint8_t>(kind), 1);
  writer_.varint(body.size());
  writer_.bytes(body);
  if (!writer_.ok()) {
    writer_.rewind(start);
    return false;
  }
  ++entries_;
  return true;
}

std::size_t DatagramWriter::room() const noexcept {
  const std::size_t room = writer_.room();
  return room < kEntryHeadBytes ? 0 : room - kEntryHeadBytes;
}

std::span<const std::byte> DatagramWriter::finish() noexcept {
  const std::uint32_t crc = crc32c(out_.first(writer_.size()));
  ByteWriter tail{out_.subspan(writer_.size(), kDatagramCrcBytes)};
  tail.fixed(crc, 4);
  return out_.first(size());
}

DatagramReader::DatagramReader(std::span<const std::byte> bytes) noexcept : in_{entries_of(bytes)} {
  if (bytes.size() < kDatagramHeadBytes + kDatagramCrcBytes || bytes.size() > kMaxDatagramBytes) {
    return;
  }
  ByteReader tail{bytes.last(kDatagramCrcBytes)};
  if (tail.fixed(4) != crc32c(bytes.first(bytes.size() - kDatagramCrcBytes))) return;
  ByteReader head{bytes};
  const std::uint64_t first = head.fixed(1);
  if ((first & 0xF0U) != kMagic) return;
  if ((first & 0x0FU) != kDatagramVersion) {
    fault_ = DatagramFault::kFuture;
    return;
  }
  head_.sender.agent = static_cast<std::uint16_t>(head.fixed(2));
  head_.sender.epoch = static_cast<std::uint32_t>(head.fixed(4));
  head_.count = static_cast<std::uint16_t>(head.fixed(2));
  fault_ = DatagramFault::kNone;
}

bool DatagramReader::next(Entry& entry) noexcept {
  if (fault_ != DatagramFault::kNone || broken_ || in_.left() == 0) return false;
  entry.kind = static_cast<EntryKind>(in_.fixed(1));
  const std::uint64_t length = in_.varint();
  broken_ = !in_.ok() || length > in_.left();
  if (broken_) return false;
  entry.body = in_.bytes(static_cast<std::size_t>(length));
  return true;
}

}  // namespace maplet
