// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/journal/items.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

namespace maplet::journal {

namespace {

constexpr std::size_t kMapletHeadBytes = 11;  // key and saliency

void write_key(ByteWriter& out, const MapletKey& key) noexcept {
  out.fixed(key.agent, 2);
  out.fixed(key.epoch, 4);
  out.fixed(key.id, 4);
}

MapletKey read_key(ByteReader& in) noexcept {
  MapletKey key;
  key.agent = static_cast<std::uint16_t>(in.fixed(2));
  key.epoch = static_cast<std::uint32_t>(in.fixed(4));
  key.id = static_cast<std::uint32_t>(in.fixed(4));
  return key;
}

void write_number(ByteWriter& out, double value) noexcept {
  out.fixed(std::bit_cast<std::uint64_t>(value), 8);
}

double read_number(ByteReader& in) noexcept { return std::bit_cast<double>(in.fixed(8)); }

void write_pose(ByteWriter& out, const NodePose& pose) noexcept {
  write_key(out, pose.key);
  write_key(out, pose.gauge);
  for (int i = 0; i < 3; ++i) write_number(out, pose.T_gauge_maplet.t[i]);
  for (int i = 0; i < 4; ++i) write_number(out, pose.T_gauge_maplet.q.coeffs()[i]);
}

bool read_pose(ByteReader& in, NodePose& pose) noexcept {
  pose.key = read_key(in);
  pose.gauge = read_key(in);
  for (int i = 0; i < 3; ++i) pose.T_gauge_maplet.t[i] = read_number(in);
  for (int i = 0; i < 4; ++i) pose.T_gauge_maplet.q.coeffs()[i] = read_number(in);
  const double length = pose.T_gauge_maplet.q.norm();
  return in.ok() && pose.T_gauge_maplet.t.allFinite() && std::abs(length - 1.0) < 1e-6;
}

bool read_maplet(ByteReader in, Visitor& visitor) noexcept {
  const MapletKey key = read_key(in);
  const float saliency = static_cast<float>(in.fixed(1)) / 255.0F;
  const auto bytes = in.bytes(in.left());
  if (!in.ok() || bytes.empty() || bytes.size() > kMaxMapletBytes) return false;
  visitor.take(key, saliency, bytes);
  return true;
}

bool read_poses(ByteReader in, Visitor& visitor) noexcept {
  std::array<NodePose, Poses::kMost> poses;
  Poses piece;
  piece.records_digest = in.fixed(8);
  piece.first = in.fixed(1) != 0;
  const auto count = static_cast<std::size_t>(in.varint_to(Poses::kMost));
  for (std::size_t i = 0; i < count; ++i) {
    if (!read_pose(in, poses[i])) return false;
  }
  piece.poses = std::span{poses}.first(count);
  if (in.ok()) visitor.take(piece);
  return in.ok();
}

bool read_part(ByteReader in, Visitor& visitor) noexcept {
  Part part;
  part.first_maplet = static_cast<std::uint32_t>(in.fixed(4));
  part.started_s = static_cast<std::int64_t>(in.fixed(8));
  if (in.ok()) visitor.take(part);
  return in.ok();
}

bool read_decision(ByteReader in, Visitor& visitor) noexcept {
  Decision decision;
  decision.a = read_key(in);
  decision.b = read_key(in);
  decision.accept = in.fixed(1) != 0;
  if (in.ok()) visitor.take(decision);
  return in.ok();
}

}  // namespace

TurnBuilder::TurnBuilder(std::span<std::byte> buffer, Life self) noexcept
    : buffer_{buffer},
      self_{self},
      out_{buffer.subspan(kHeadBytes, std::min(buffer.size(), kMaxTurnBytes) - kHeadBytes)},
      context_{self.agent, self.epoch} {}

void TurnBuilder::clear() noexcept {
  out_.rewind(0);
  context_ = RecordContext{self_.agent, self_.epoch};
}

bool TurnBuilder::put(ItemKind kind, std::span<const std::byte> body) noexcept {
  const std::size_t before = out_.size();
  out_.fixed(static_cast<std::uint64_t>(kind), 1);
  out_.varint(body.size());
  out_.bytes(body);
  const bool fits = out_.ok();
  if (!fits) out_.rewind(before);
  return fits;
}

void TurnBuilder::note(const RecordKey& key) noexcept {
  if (Life{key.agent, key.epoch} != self_) return;
  std::uint32_t& end = ends_[static_cast<std::size_t>(key.stream)];
  end = std::max(end, key.seq + 1);
}

template <class Record>
bool TurnBuilder::put_record(ItemKind kind, const Record& record) noexcept {
  std::array<std::byte, kMaxRecordBytes> body;
  ByteWriter writer{body};
  RecordContext after = context_;
  write_record(writer, after, record);
  if (!writer.ok() || !put(kind, std::span{body}.first(writer.size()))) return false;
  context_ = after;
  note(record.key);
  return true;
}

bool TurnBuilder::add(const DeltaPoseRecord& record) noexcept {
  return put_record(ItemKind::kDeltaPose, record);
}

bool TurnBuilder::add(const RangeRecord& record) noexcept {
  return put_record(ItemKind::kRange, record);
}

bool TurnBuilder::add(const MapletKey& key, float saliency,
                      std::span<const std::byte> bytes) noexcept {
  const std::size_t before = out_.size();
  out_.fixed(static_cast<std::uint64_t>(ItemKind::kMaplet), 1);
  out_.varint(kMapletHeadBytes + bytes.size());
  write_key(out_, key);
  out_.fixed(static_cast<std::uint64_t>(std::lround(std::clamp(saliency, 0.0F, 1.0F) * 255.0F)), 1);
  out_.bytes(bytes);
  if (!out_.ok()) {
    out_.rewind(before);
    return false;
  }
  note({key.agent, key.epoch, Stream::kMaplets, key.id});
  return true;
}

bool TurnBuilder::add(const Part& part) noexcept {
  std::array<std::byte, 12> body;
  ByteWriter writer{body};
  writer.fixed(part.first_maplet, 4);
  writer.fixed(static_cast<std::uint64_t>(part.started_s), 8);
  return put(ItemKind::kPart, body);
}

bool TurnBuilder::add(const Decision& decision) noexcept {
  std::array<std::byte, 21> body;
  ByteWriter writer{body};
  write_key(writer, decision.a);
  write_key(writer, decision.b);
  writer.fixed(decision.accept ? 1 : 0, 1);
  return put(ItemKind::kDecision, body);
}

bool TurnBuilder::add(const Poses& piece) noexcept {
  std::array<std::byte, 10 + Poses::kMost * 76> body;
  ByteWriter writer{body};
  writer.fixed(piece.records_digest, 8);
  writer.fixed(piece.first ? 1 : 0, 1);
  writer.varint(piece.poses.size());
  for (const NodePose& pose : piece.poses) write_pose(writer, pose);
  return writer.ok() && put(ItemKind::kPoses, std::span{body}.first(writer.size()));
}

bool read_items(std::span<const std::byte> payload, Life self, Visitor& visitor) noexcept {
  ByteReader in{payload};
  RecordContext context{self.agent, self.epoch};
  while (in.left() > 0) {
    const auto kind = static_cast<ItemKind>(in.fixed(1));
    const auto length = static_cast<std::size_t>(in.varint());
    ByteReader body{in.bytes(length)};
    if (!in.ok()) return false;
    bool good = true;
    switch (kind) {
      case ItemKind::kDeltaPose: {
        const auto record = read_delta_pose(body, context);
        good = record && body.left() == 0;
        if (good) visitor.take(*record);
        break;
      }
      case ItemKind::kRange: {
        const auto record = read_range(body, context);
        good = record && body.left() == 0;
        if (good) visitor.take(*record);
        break;
      }
      case ItemKind::kMaplet:
        good = read_maplet(body, visitor);
        break;
      case ItemKind::kPart:
        good = read_part(body, visitor);
        break;
      case ItemKind::kDecision:
        good = read_decision(body, visitor);
        break;
      case ItemKind::kPoses:
        good = read_poses(body, visitor);
        break;
    }
    if (!good) return false;
  }
  return true;
}

}  // namespace maplet::journal
