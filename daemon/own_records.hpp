// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/agent/agent.hpp"
#include "core/base/static_vector.hpp"
#include "core/ports/record_sink.hpp"
#include "transport/exchange/delta_pose_record.hpp"
#include "transport/exchange/range_record.hpp"

namespace maplet::daemon {

/// Numbers what this agent finds out and keeps the records of one step until they are handed out.
///
/// Memory  fixed.
class OwnRecords final : public RecordSink {
 public:
  static constexpr std::size_t kPerStep = 16;

  explicit OwnRecords(AgentIdentity identity) noexcept : identity_{identity} {}

  /// Numbers go on from here.
  void go_on(const std::array<std::uint32_t, kStreams>& next_seq) noexcept { next_seq_ = next_seq; }

  [[nodiscard]] std::optional<DeltaPose> put(const DeltaPose& delta) noexcept override;
  [[nodiscard]] std::optional<MapletRange> put(const MapletRange& range) noexcept override;

  [[nodiscard]] std::span<const DeltaPoseRecord> pending() const noexcept {
    return {pending_.data(), pending_.size()};
  }
  [[nodiscard]] std::span<const RangeRecord> pending_ranges() const noexcept {
    return {pending_ranges_.data(), pending_ranges_.size()};
  }
  void clear_pending() noexcept {
    pending_.clear();
    pending_ranges_.clear();
  }
  /// Delta-poses that no record could hold.
  [[nodiscard]] std::uint64_t refused() const noexcept { return refused_; }

 private:
  AgentIdentity identity_;
  std::array<std::uint32_t, kStreams> next_seq_{};
  StaticVector<DeltaPoseRecord, kPerStep> pending_;
  StaticVector<RangeRecord, kPerStep> pending_ranges_;
  std::uint64_t refused_ = 0;
};

}  // namespace maplet::daemon
