// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/geometry/se3.hpp"
#include "core/maplet/maplet.hpp"
#include "daemon/journal/format.hpp"
#include "transport/exchange/record_codec.hpp"

/// What stands in a turn: kind (octet), length (varint), body. Records and maplets as on the radio.
namespace maplet::journal {

/// Numbers are for ever; unknown ones are skipped.
enum class ItemKind : std::uint8_t {
  kDeltaPose = 1,  ///< as EntryKind's
  kRange = 2,
  kMaplet = 16,
  kPart = 17,
  kDecision = 18,
  kPoses = 19,
};

/// A start of the daemon: own maplets from here on have no known relation to those before.
struct Part {
  std::uint32_t first_maplet = 0;
  std::int64_t started_s = 0;  ///< wall clock, Unix

  friend bool operator==(const Part&, const Part&) = default;
};

/// An operator's verdict on the closures between two maplets.
struct Decision {
  MapletKey a;
  MapletKey b;
  bool accept = false;

  friend bool operator==(const Decision&, const Decision&) = default;
};

/// Where the skeleton had a maplet.
struct NodePose {
  MapletKey key;
  MapletKey gauge;  ///< whose frame
  Se3 T_gauge_maplet;
};

/// A piece of a snapshot of the skeleton. Memory   a view.
struct Poses {
  std::uint64_t records_digest = 0;  ///< of the records that it was made of
  bool first = false;                ///< what was told before is old
  std::span<const NodePose> poses;

  static constexpr std::size_t kMost = 64;
};

/// Who takes in what a mission holds, in the order it was written.
class Visitor {
 public:
  virtual ~Visitor() = default;
  virtual void take(const DeltaPoseRecord&) noexcept {}
  virtual void take(const RangeRecord&) noexcept {}
  /// @param bytes  encoded; valid during the call
  virtual void take(const MapletKey&, float /*saliency*/,
                    std::span<const std::byte> /*bytes*/) noexcept {}
  virtual void take(const Part&) noexcept {}
  virtual void take(const Decision&) noexcept {}
  virtual void take(const Poses&) noexcept {}
};

/// Puts items into a turn.
///
/// Memory   a view of the caller's buffer, at least kMaxTurnBytes.
class TurnBuilder {
 public:
  TurnBuilder(std::span<std::byte> buffer, Life self) noexcept;

  // @return whether there was room
  bool add(const DeltaPoseRecord& record) noexcept;
  bool add(const RangeRecord& record) noexcept;
  bool add(const MapletKey& key, float saliency, std::span<const std::byte> bytes) noexcept;
  bool add(const Part& part) noexcept;
  bool add(const Decision& decision) noexcept;
  bool add(const Poses& poses) noexcept;

  [[nodiscard]] bool empty() const noexcept { return out_.size() == 0; }
  [[nodiscard]] std::size_t payload_bytes() const noexcept { return out_.size(); }
  [[nodiscard]] std::span<const std::byte> payload() const noexcept {
    return buffer_.subspan(kHeadBytes, out_.size());
  }
  /// Head's place and payload.
  [[nodiscard]] std::span<std::byte> turn() noexcept {
    return buffer_.first(kHeadBytes + out_.size());
  }
  [[nodiscard]] Life self() const noexcept { return self_; }
  /// Own records up to here, all of them: what ends() of the head says.
  [[nodiscard]] const std::array<std::uint32_t, kStreams>& ends() const noexcept { return ends_; }
  void know_ends(const std::array<std::uint32_t, kStreams>& ends) noexcept { ends_ = ends; }
  void clear() noexcept;

 private:
  bool put(ItemKind kind, std::span<const std::byte> body) noexcept;
  template <class Record>
  bool put_record(ItemKind kind, const Record& record) noexcept;
  void note(const RecordKey& key) noexcept;

  std::span<std::byte> buffer_;
  Life self_;
  ByteWriter out_;
  RecordContext context_;
  std::array<std::uint32_t, kStreams> ends_{};
};

/// Hands the items of a payload to the visitor. @return false when the payload makes no sense:
/// what was understood before was handed over
bool read_items(std::span<const std::byte> payload, Life self, Visitor& visitor) noexcept;

}  // namespace maplet::journal
