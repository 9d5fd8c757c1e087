// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <vector>

#include "core/agent/agent.hpp"
#include "core/ports/depth_source.hpp"
#include "daemon/config_io.hpp"
#include "daemon/flight_writer.hpp"
#include "daemon/options.hpp"
#include "daemon/pacer.hpp"
#include "drivers/flight/flight_file.hpp"

namespace maplet::daemon {

/// A run that was recorded, to be replayed.
struct Flight {
  std::unique_ptr<flight::RingReader> file;
  AgentIdentity identity;
  std::string source;  ///< its frames came from
  Pace pace = Pace::kFast;
  bool radio = false;
  bool finite = false;
  bool resumed = false;  ///< it went on with a mission, which stands before the first frame
};

/// Replays have no source: FlightLog gives the frames.
class NoSource final : public DepthSource {
 public:
  [[nodiscard]] Expected<DepthFrame> next(Deadline) noexcept override {
    return fail(ErrorCode::kEnd, "a replay");
  }
  [[nodiscard]] SourceCounters counters() const noexcept override { return {}; }
};

/// @return one line why record:FILE cannot be replayed, one whose URI is in order; empty: it can
[[nodiscard]] std::string flight_problem(const std::string& source);

/// What of the command line a replay does nothing with: it is what ran. A line each.
[[nodiscard]] std::vector<std::string> without_effect(const Options& options, const Config& config,
                                                      const Flight& flight);

[[nodiscard]] bool is_record(std::string_view source) noexcept;

/// With which a recorded run ran. @param source  record:FILE
[[nodiscard]] tl::expected<Config, ConfigError> recorded_config(const std::string& source);

/// @return nothing when the source is no record; why it cannot be replayed
[[nodiscard]] tl::expected<std::optional<Flight>, std::string> open_flight(const Config& config);

/// Begins recorder.file. @return why not
[[nodiscard]] tl::expected<std::unique_ptr<FlightWriter>, std::string> start_recording(
    const Config& config, AgentIdentity identity, Pace pace, bool radio, bool finite, bool resumed);

}  // namespace maplet::daemon
