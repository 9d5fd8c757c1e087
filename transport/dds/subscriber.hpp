// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <variant>

#include "core/base/clock.hpp"
#include "core/base/expected.hpp"
#include "transport/dds/config.hpp"
#include "transport/dds/domain.hpp"
#include "transport/exchange/delta_pose_record.hpp"
#include "transport/exchange/maplet_record.hpp"
#include "transport/exchange/status_record.hpp"

namespace maplet {

/// Reads what agents put into the local domain, from the last `history` messages on.
///
/// Memory   up to 8192 untaken delta-poses, 64 maplets; one maplet's bytes in the object.
/// Threads  one caller.
class DdsSubscriber {
 public:
  struct Wanted {
    bool delta_poses = true;
    bool maplets = true;
    bool statuses = true;
  };
  using Message = std::variant<DeltaPoseRecord, MapletRecord, StatusRecord>;

  [[nodiscard]] static tl::expected<std::unique_ptr<DdsSubscriber>, DdsFailure> open(
      const DdsConfig& config, Wanted wanted);
  ~DdsSubscriber();
  DdsSubscriber(const DdsSubscriber&) = delete;
  DdsSubscriber& operator=(const DdsSubscriber&) = delete;

  /// @return the next message (a maplet's bytes until the next call), kTimeout, or kIo. Messages
  ///   that no honest agent sends are skipped and counted.
  [[nodiscard]] Expected<Message> next(Duration limit) noexcept;

  [[nodiscard]] std::uint64_t rejected() const noexcept;
  /// Publishers of wanted topics now.
  [[nodiscard]] std::uint32_t publishers() const noexcept;

 private:
  class Impl;
  explicit DdsSubscriber(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace maplet
