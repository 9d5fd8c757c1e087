// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>

#include "core/agent/agent.hpp"
#include "core/base/arena.hpp"
#include "core/ports/depth_source.hpp"
#include "daemon/config.hpp"
#include "daemon/console.hpp"
#include "daemon/log.hpp"
#include "daemon/options.hpp"
#include "daemon/own_records.hpp"
#include "daemon/pacer.hpp"
#include "daemon/radio_link.hpp"
#include "daemon/run_output.hpp"
#include "daemon/run_totals.hpp"
#include "daemon/stage_stats.hpp"
#include "transport/dds/publisher.hpp"

namespace maplet::daemon {

inline constexpr int kExitDone = 0;
inline constexpr int kExitFailure = 1;
inline constexpr int kExitUsage = 2;

/// mapletd itself: a source, an agent, and where the results go.
///
/// Start-up allocates; after READY the frame loop does not. SIGTERM and SIGINT end the loop, and
/// what is there is written.
class App {
 public:
  App(const Options& options, const Config& config);
  ~App();

  /// @return the process's exit code
  [[nodiscard]] int run();

 private:
  enum class Read : std::uint8_t { kFrame, kNothing, kEnd, kFailed };

  // Start-up; exit codes.
  [[nodiscard]] int open();
  [[nodiscard]] int open_source();  // the service waits here for a camera

  // The loop.
  [[nodiscard]] bool loop();  // until the end, a signal, or a failure: false
  [[nodiscard]] Read read(DepthFrame& frame);
  void process(const DepthFrame& frame);
  void hand_out(const MapletCut* closed);
  void listen(int meetings);  // to what others found out
  void open_console();        // for mapletctl; does without it
  void rest();                // the service has nothing to see: it goes on exchanging
  template <class Record>
  void publish(const Record& record);
  void say_detail();  // what the source had to skip, once
  [[nodiscard]] StatusRecord status(StatusRecord::State state) const;
  void say_tracking(const Track& track) noexcept;
  void publish_status(StatusRecord::State state);

  // The end of a finite run.
  [[nodiscard]] int finish();
  [[nodiscard]] bool draw();
  [[nodiscard]] bool write_report();

  const Options& options_;
  const Config& config_;
  AgentIdentity identity_;
  Arena arena_;
  StageMeters meters_;
  OwnRecords records_;
  Arena::Owned<Agent> agent_;
  Pacer pacer_;
  RunTotals totals_;
  std::unique_ptr<DepthSource> source_;
  std::unique_ptr<RunOutput> output_;
  std::unique_ptr<DdsPublisher> publisher_;
  std::unique_ptr<RadioLink> radio_;
  std::unique_ptr<Console> console_;  ///< asks the radio: ends before it
  MonotonicClock monotonic_;
  Instant start_;
  Instant last_status_{};
  Stamp last_stamp_{};
  bool tracking_ = false;
  int timeouts_ = 0;  ///< in a row
  FewLines warnings_;
  std::string said_;
  std::array<std::byte, kMaxMapletBytes> maplet_bytes_{};
};

}  // namespace maplet::daemon
