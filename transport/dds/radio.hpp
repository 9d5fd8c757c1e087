// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "core/base/clock.hpp"
#include "transport/dds/domain.hpp"
#include "transport/dds/radio_config.hpp"
#include "transport/sync/scheduler.hpp"

namespace maplet {

/// Who gets what the radio hears.
class FrameTaker {
 public:
  virtual ~FrameTaker() = default;
  virtual void take(std::span<const std::byte> datagram) noexcept = 0;
};

/// The link to the other agents over DDS: datagrams out, datagrams in. All BEST_EFFORT, VOLATILE:
/// the exchange repairs what is lost, DDS repeats nothing but its discovery.
///
/// Memory   Cyclone's own, bounded by the configuration: docs/memory.md.
/// Threads  one caller, and Cyclone's own.
class DdsRadio {
 public:
  /// @param security  nullptr: without DDS Security
  /// @return an open link, or why not: kDevice when the interface is not there (yet)
  [[nodiscard]] static tl::expected<std::unique_ptr<DdsRadio>, DdsFailure> open(
      const RadioConfig& config, int domain, int agent, const DdsSecurityFiles* security = nullptr);
  ~DdsRadio();
  DdsRadio(const DdsRadio&) = delete;
  DdsRadio& operator=(const DdsRadio&) = delete;

  /// Sends at once. @return false when Cyclone refused
  bool write(Traffic lane, std::span<const std::byte> datagram) noexcept;
  /// Tells everybody on the link that we are here, beside what DDS does on its own.
  void announce() noexcept;
  /// Waits for datagrams, at most so long; hands out those that are there.
  /// @return how many
  int receive(Duration limit, FrameTaker& taker) noexcept;
  /// Ends a receive() that waits. Threads any.
  void interrupt() noexcept;

  /// Readers of our datagrams now, on other hosts or in other processes.
  [[nodiscard]] std::uint32_t listeners() const noexcept;
  /// What one datagram goes out as: one multicast, or a copy a listener.
  [[nodiscard]] std::uint32_t copies() const noexcept;
  /// Participants that DDS Security kept out, since this link was opened.
  [[nodiscard]] std::uint64_t strangers(Instant now) noexcept;
  /// False when the interface is gone, down, another one of the same name, or has another address:
  /// close this link and open a new one.
  [[nodiscard]] bool interface_holds() const noexcept;

 private:
  class Impl;
  explicit DdsRadio(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace maplet
