// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "core/base/clock.hpp"
#include "transport/dds/config.hpp"
#include "transport/dds/domain.hpp"
#include "transport/exchange/delta_pose_record.hpp"
#include "transport/exchange/maplet_record.hpp"
#include "transport/exchange/range_report.hpp"
#include "transport/exchange/status_record.hpp"

namespace maplet {

/// Somebody else who writes and reads in the same domain, as the same participant: one process has
/// one in a domain.
class LocalGuest {
 public:
  virtual ~LocalGuest() = default;
  /// The domain is open; makes what it needs there, which ends with the domain. Called once, by
  /// whoever opened it.
  /// @return what was refused, on one line; empty: nothing
  [[nodiscard]] virtual std::string join(std::int32_t participant) = 0;
};

/// Puts an agent's delta-poses, maplets and status into the local domain; takes ranges from it.
///
/// Memory   queues fixed at construction (about 0.7 MB); Cyclone's own in docs/memory.md.
/// Threads  publish() from one thread, the estimator's; it never allocates, never blocks and never
///   waits for Cyclone: a thread of the publisher writes. Everything else from any thread.
class DdsPublisher {
 public:
  enum class Missing : std::uint8_t {
    kFail,  ///< an interface that is not there is an error: a finite run
    kWait,  ///< keep trying once a second: the service. Records wait in the queues meanwhile
  };

  struct Counters {
    std::uint64_t delta_poses = 0;  ///< written
    std::uint64_t maplets = 0;
    std::uint64_t statuses = 0;
    std::uint64_t dropped = 0;  ///< refused by a full queue
    std::uint64_t failed = 0;   ///< refused by Cyclone
  };

  /// @param guest  outlives the publisher
  /// @return a running publisher, or why not: one line with the remedy
  [[nodiscard]] static tl::expected<std::unique_ptr<DdsPublisher>, DdsFailure> start(
      const DdsConfig& config, int agent, Missing missing, LocalGuest* guest = nullptr);

  /// Writes what is queued, for a moment, and leaves the domain.
  ~DdsPublisher();
  DdsPublisher(const DdsPublisher&) = delete;
  DdsPublisher& operator=(const DdsPublisher&) = delete;

  /// @return false when the queue was full: counted, the record is lost to the local domain
  [[nodiscard]] bool publish(const DeltaPoseRecord& record) noexcept;
  /// Copies the bytes; also false when they are more than kMaxMapletBytes.
  [[nodiscard]] bool publish(const MapletRecord& record) noexcept;
  [[nodiscard]] bool publish(const StatusRecord& record) noexcept;

  /// The next range that a program on this robot measured. @return false when there is none
  [[nodiscard]] bool measured(RangeReport& report) noexcept;

  /// Waits until everything published is written and every subscriber known has it; looks for
  /// subscribers that are only just arriving, too. For the end of a finite run.
  /// @return false when `limit` passed before
  [[nodiscard]] bool flush(Duration limit) noexcept;

  /// False while waiting for the interface.
  [[nodiscard]] bool open() const noexcept;
  /// Subscribers of delta-poses now.
  [[nodiscard]] std::uint32_t subscribers() const noexcept;
  [[nodiscard]] Counters counters() const noexcept;

 private:
  class Impl;
  explicit DdsPublisher(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace maplet
