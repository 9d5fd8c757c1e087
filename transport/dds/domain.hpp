// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "core/base/expected.hpp"
#include "transport/dds/config.hpp"

namespace maplet {

/// A DDS error in words that a person can act on, beside the code that a program acts on.
struct DdsFailure {
  ErrorCode code = ErrorCode::kDevice;  ///< kDevice: the interface is not there (yet), try again
  std::string what;                     ///< one line: what, where, remedy
};

/// One participant in one domain of this process. Everything made from it ends with it.
///
/// Memory   Cyclone's own, bounded by the configuration: docs/memory.md.
/// Threads  Cyclone's own, all signals blocked.
class DdsDomain {
 public:
  enum class Role : std::uint8_t { kDaemon, kWatcher };

  /// @param agent  of a daemon: its participant index follows it
  [[nodiscard]] static tl::expected<DdsDomain, DdsFailure> open(const DdsConfig& config, Role role,
                                                                int agent = 0);

  /// Which of several participant indices to take, and what to configure with it.
  struct Choice {
    int domain = 0;
    std::string interface;
    int first = 0;
    int count = 1;
    int wanted = 0;  ///< counted from `first`: the first to be tried
    std::function<std::string(int index, bool multicast)> xml;
  };
  [[nodiscard]] static tl::expected<DdsDomain, DdsFailure> open(const Choice& choice);
  DdsDomain(DdsDomain&& other) noexcept;
  DdsDomain& operator=(DdsDomain&&) = delete;
  ~DdsDomain();

  [[nodiscard]] std::int32_t participant() const noexcept { return participant_; }
  [[nodiscard]] int participant_index() const noexcept { return index_; }

 private:
  DdsDomain(std::int32_t domain, std::int32_t participant, int index) noexcept
      : domain_{domain}, participant_{participant}, index_{index} {}

  std::int32_t domain_;
  std::int32_t participant_;
  int index_;
};

/// Why `interface` cannot carry DDS now; nothing when it can.
[[nodiscard]] std::optional<std::string> interface_problem(const std::string& interface);

}  // namespace maplet
