// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>

#include "core/agent/agent.hpp"
#include "core/base/arena.hpp"
#include "core/ports/depth_source.hpp"
#include "daemon/capture_thread.hpp"
#include "daemon/config.hpp"
#include "daemon/console.hpp"
#include "daemon/flight_log.hpp"
#include "daemon/flight_setup.hpp"
#include "daemon/governor.hpp"
#include "daemon/gpio_panel.hpp"
#include "daemon/heartbeat.hpp"
#include "daemon/journal_writer.hpp"
#include "daemon/live_config.hpp"
#include "daemon/log.hpp"
#include "daemon/memory_status.hpp"
#include "daemon/neighbours.hpp"
#include "daemon/options.hpp"
#include "daemon/own_records.hpp"
#include "daemon/pacer.hpp"
#include "daemon/radio_link.hpp"
#include "daemon/run_output.hpp"
#include "daemon/run_totals.hpp"
#include "daemon/security_setup.hpp"
#include "daemon/signals.hpp"
#include "daemon/stage_stats.hpp"
#include "daemon/state_directory.hpp"
#include "daemon/status_board.hpp"
#include "daemon/supervisor.hpp"
#include "drivers/gray_camera.hpp"
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
  App(const Options& options, const Config& config, StateDirectory state,
      std::optional<Flight> flight, const std::optional<SecuritySetup>& security = {});
  ~App();

  /// @return the process's exit code
  [[nodiscard]] int run();

 private:
  static constexpr int kMeetings = 8;  ///< steps of looking for common places, while no frame waits
  enum class Read : std::uint8_t { kFrame, kNothing, kEnd, kFailed };

  // app_open.cpp: start-up; exit codes.
  [[nodiscard]] int open();
  [[nodiscard]] int open_source(bool again);  // the service waits here for a camera
  [[nodiscard]] bool has_room_for(const DepthSource& source) const;
  void take_source(std::unique_ptr<DepthSource> source);
  void close_source();
  [[nodiscard]] SourceCounters source_counters() const;
  [[nodiscard]] bool allowed(const std::optional<std::string>& problem);  // to run without
  void open_console();  // for mapletctl; does without it
  [[nodiscard]] bool open_gpio();
  [[nodiscard]] bool open_gray();
  void reload();  // the housekeeping thread's

  // app.cpp: the loop.
  [[nodiscard]] bool loop();  // until the end, a signal, or a failure: false
  [[nodiscard]] Read read(DepthFrame& frame);
  [[nodiscard]] Expected<DepthFrame> ask_source(Duration patience) noexcept;
  void process(const DepthFrame& frame);
  /// Of work with this budget: in fast pace none at all.
  [[nodiscard]] Deadline deadline(Duration budget) const noexcept {
    return pace_ == Pace::kFast ? Deadline::never() : Deadline{flight_, budget};
  }
  void hand_out(const MapletCut* closed);
  void listen(int meetings);  // to what others found out
  void hear_others(Deadline until);
  void say_what_is_near();      // which maplets of others to ask for first
  void take_ranges();           // that programs on this robot measured
  void settle(Deadline spare);  // the skeleton, when nothing was found out for a moment
  void rest();                  // the service has nothing to see: it goes on exchanging
  template <class Record>
  void publish(const Record& record);
  void say_detail();  // what the source had to skip, once
  void say_tracking(const Track& track) noexcept;
  void set_tracking(bool tracking) noexcept;  // as the lines show it
  void stay_held();                           // while the switch is on

  /// Others are listened to: there is a link, or was in the run that is replayed.
  [[nodiscard]] bool linked() const noexcept {
    return replayed_ ? replayed_->radio : radio_ != nullptr;
  }
  /// A run to the end of its source; of a replay: what ran was.
  [[nodiscard]] bool finite() const noexcept {
    return replayed_ ? replayed_->finite : output_ != nullptr;
  }
  [[nodiscard]] bool over() const noexcept { return stop_asked() || flight_.over(); }
  [[nodiscard]] bool open_recorder();

  // app_journal.cpp
  void open_journal();
  void resume_mission();  // before the radio starts
  void note_skeleton(bool all);
  void close_journal();
  [[nodiscard]] static std::int64_t wall_clock_s();
  /// Own records go on the air, with a journal once they are safe.
  template <class Record>
  void put_on_air(const Record& record) {
    if (journal_) {
      journal_->put(record);
    } else if (radio_) {
      (void)radio_->publish(record);
    }
  }

  // app_status.cpp
  [[nodiscard]] StatusRecord status(StatusRecord::State state) const;
  void publish_status(StatusRecord::State state);

  // app_finish.cpp: the end of a finite run.
  [[nodiscard]] int finish();
  void linger();
  [[nodiscard]] bool draw();
  [[nodiscard]] bool write_report();
  void say_notable() const;
  void say_plane();

  const Options& options_;
  const Config& config_;
  StateDirectory state_;
  std::optional<Flight> replayed_;  ///< the run that is replayed
  FlightLog flight_;                ///< the clock, and all else that comes from outside
  AgentIdentity identity_;
  Arena arena_;
  StageMeters meters_;
  OwnRecords records_;
  Arena::Owned<Agent> agent_;
  Pace pace_;
  RunTotals totals_;
  std::unique_ptr<FramePool> frames_;  ///< none in fast pace
  std::unique_ptr<GrayCamera> gray_;   ///< beside the depth camera; outlives the source
  std::unique_ptr<DepthSource> source_;
  CaptureThread* capture_ = nullptr;  ///< source_, where it has a thread of its own
  DurationHistogram latency_;         ///< from the camera's runtime to a frame here
  Governor governor_;
  std::unique_ptr<RunOutput> output_;
  StatusBoard board_;
  std::unique_ptr<Neighbours> neighbours_;  ///< guests of the publisher: end after it
  std::unique_ptr<DdsPublisher> publisher_;
  std::unique_ptr<RadioLink> radio_;
  std::unique_ptr<JournalWriter> journal_;  ///< tells the radio: ends before it
  MonotonicClock machine_;                  ///< for what decides nothing
  LiveConfig live_;
  std::unique_ptr<MemoryStatus> memory_;
  Heartbeat heart_;                   ///< of the loop
  std::unique_ptr<GpioPanel> gpio_;   ///< looks at the heart; none where no line is used
  std::unique_ptr<Console> console_;  ///< asks the radio and the panel: ends before them
  Instant start_;
  Duration budget_;  ///< of a frame
  Duration given_;   ///< of it, what the governor lets the stages have
  Instant last_status_{};
  Instant last_near_{};
  Instant snapshot_at_{};
  Instant piece_at_{};
  std::uint64_t snapshot_digest_ = 0;
  int snapshot_next_ = -1;  ///< node; -1: none is being made
  Instant last_news_{};     ///< something entered the skeleton
  Stamp last_stamp_{};
  bool tracking_ = false;
  bool plane_doubted_ = false;  ///< and said
  FreeAxes free_;               ///< of the newest frame
  Fills fills_;
  int timeouts_ = 0;   ///< in a row
  FewLines warnings_;  ///< written by the housekeeping thread
  Line said_;
  Line gray_said_;
  SourceCounters gone_;                    ///< of sources that were closed
  std::optional<SourceCounters> counted_;  ///< at the end of the loop
  std::array<std::byte, kMaxMapletBytes> maplet_bytes_{};
  std::unique_ptr<Supervisor> supervisor_;  ///< looks at much of the above: ends first
};

/// What a mission's store keeps under a configuration.
[[nodiscard]] JournalWriter::Config journal_config(const Config& config);

}  // namespace maplet::daemon
