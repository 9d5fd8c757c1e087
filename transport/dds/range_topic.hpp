// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>

#include "core/base/clock.hpp"
#include "transport/dds/config.hpp"
#include "transport/dds/domain.hpp"
#include "transport/exchange/range_report.hpp"

namespace maplet {

/// Reads ranges to other agents from the local domain: topic maplet/range.
///
/// Memory   up to 64 untaken in Cyclone, 256 in a queue.
/// Threads  pop() by one caller, without waiting or allocation; Cyclone's fills the queue.
class RangeInbox {
 public:
  /// @param agent  whose reports are taken
  explicit RangeInbox(std::uint16_t agent);
  ~RangeInbox();
  RangeInbox(const RangeInbox&) = delete;
  RangeInbox& operator=(const RangeInbox&) = delete;

  /// Reads in this participant's domain until the participant ends. @return false: Cyclone refused
  [[nodiscard]] bool open(std::int32_t participant);
  [[nodiscard]] bool pop(RangeReport& report) noexcept;
  /// Reports that made no sense, or found the queue full.
  [[nodiscard]] std::uint64_t rejected() const noexcept;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// Writes ranges into the local domain, as a program beside a radio does.
class RangeWriter {
 public:
  [[nodiscard]] static tl::expected<std::unique_ptr<RangeWriter>, DdsFailure> open(
      const DdsConfig& config);
  ~RangeWriter();
  RangeWriter(const RangeWriter&) = delete;
  RangeWriter& operator=(const RangeWriter&) = delete;

  /// Waits for somebody who reads. @return false when nobody came
  [[nodiscard]] bool wait_for_reader(Duration limit) noexcept;
  /// @return false when it was not acknowledged in time
  [[nodiscard]] bool write(const RangeReport& report, Duration limit) noexcept;

 private:
  class Impl;
  explicit RangeWriter(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace maplet
