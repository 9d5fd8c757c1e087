// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/agent/agent.hpp"
#include "core/ports/depth_source.hpp"
#include "daemon/flight_writer.hpp"
#include "drivers/flight/event_reader.hpp"
#include "drivers/flight/events.hpp"
#include "drivers/flight/flight_file.hpp"
#include "transport/exchange/range_report.hpp"
#include "transport/exchange/record_codec.hpp"

namespace maplet::daemon {

/// Everything that reaches the estimator's thread from outside goes through here: time, frames,
/// records of others, operators. Recording it notes what came; replaying it gives what came then,
/// so that the same decisions are taken, those included that depended on time.
///
/// Off, it passes everything on. A question that the replayed run did not ask at that place
/// (another configuration) gets the last time known, or nothing.
///
/// Memory   a buffer of kStaged; replay allocates. Time  O(1) a question, recording a frame copies
/// it. Threads  the estimator's.
class FlightLog final : public Clock {
 public:
  static constexpr std::size_t kStaged = 32 * 1024;

  /// @param pixels  of the largest frame
  void record(std::unique_ptr<FlightWriter> writer, bool patient, std::size_t pixels);
  /// @param most  the largest image that there is room for
  void replay(std::unique_ptr<flight::RingReader> reader, ImageSize most) {
    events_ = std::make_unique<flight::EventReader>(std::move(reader), most);
  }
  [[nodiscard]] bool recording() const noexcept { return writer_ != nullptr; }
  [[nodiscard]] bool replaying() const noexcept { return events_ != nullptr; }
  /// Replaying: it ended where something cannot be read.
  [[nodiscard]] bool damaged() const noexcept { return events_ && events_->damaged(); }
  [[nodiscard]] FlightWriter* writer() noexcept { return writer_.get(); }

  [[nodiscard]] Instant now() const noexcept override;

  /// @param next  how the source is asked
  template <class Next>
  [[nodiscard]] Expected<DepthFrame> frame(Next&& next) noexcept {
    if (events_) return events_->frame();
    auto came = next();
    if (writer_) note(came);
    return came;
  }
  /// @param hear  fills the record. @return whether one came
  template <class Record, class Hear>
  [[nodiscard]] bool heard(Record& record, Hear&& hear) noexcept {
    if (events_) return replayed(record);
    const bool came = hear();
    if (came && writer_) note(record);
    return came;
  }
  /// @return its size, 0: none
  template <class Hear>
  [[nodiscard]] std::size_t heard_maplet(MapletKey& key, std::span<std::byte> bytes,
                                         Hear&& hear) noexcept {
    if (events_) return replayed_maplet(key, bytes);
    const std::size_t size = hear();
    if (size > 0 && writer_) note(key, bytes.first(size));
    return size;
  }
  [[nodiscard]] bool flag(bool value) noexcept;
  [[nodiscard]] Duration budget(Duration value) noexcept;
  [[nodiscard]] std::optional<Duration> offset(std::optional<Duration> value) noexcept;

  void said(const DeltaPose& closure) noexcept;  ///< an operator
  void decided(const MapletKey& a, const MapletKey& b, bool accept) noexcept;
  [[nodiscard]] bool replayed_decision(MapletKey& a, MapletKey& b, bool& accept) noexcept;
  /// Replaying: does what operators did here.
  void repeat_operators(Agent& agent) noexcept;

  void note_stop(const SourceCounters& counters) noexcept;
  /// Replaying: what its source had counted.
  void replayed_stop(SourceCounters& counters) noexcept;
  void note_mark() noexcept { note_event(flight::Event::kMark, {}); }
  void note_restored(const std::array<std::uint32_t, kStreams>& ends) noexcept;
  /// Replaying: that was all of earlier runs. @param ends  own records up to here
  [[nodiscard]] bool replayed_restored(std::array<std::uint32_t, kStreams>& ends) noexcept;
  void wait_for_disk(bool patient) noexcept { patient_ = patient; }
  void note(const DeltaPoseRecord& record) noexcept;
  void note(const RangeRecord& record) noexcept;
  void note(const RangeReport& report) noexcept;
  void note(const MapletKey& key, std::span<const std::byte> bytes) noexcept;
  /// Replaying: what comes next is that; it is taken.
  [[nodiscard]] bool take(flight::Event event) noexcept;
  [[nodiscard]] flight::Event peek() const noexcept {
    return events_ ? events_->peek() : flight::Event{};
  }
  /// Replaying: the loop was over here, or nothing more is recorded.
  [[nodiscard]] bool over() const noexcept { return events_ && events_->over(); }
  /// Replaying: once a round of a loop that may wait for something.
  void keep_going() noexcept {
    if (events_) events_->keep_going();
  }
  [[nodiscard]] bool replayed(DeltaPoseRecord& record) noexcept;
  [[nodiscard]] bool replayed(RangeRecord& record) noexcept;
  [[nodiscard]] bool replayed(RangeReport& report) noexcept;
  [[nodiscard]] std::size_t replayed_maplet(MapletKey& key, std::span<std::byte> bytes) noexcept;
  /// Hands over what is staged.
  void flush() const noexcept;

 private:
  void note(const Expected<DepthFrame>& frame) noexcept;
  void note_event(flight::Event event, std::span<const std::byte> body) const noexcept;
  template <class Pixel>
  void note_pixels(flight::Block type, const ImageView<Pixel>& image) noexcept;

  MonotonicClock monotonic_;
  std::unique_ptr<FlightWriter> writer_;
  bool patient_ = false;
  mutable std::vector<std::byte> staged_;
  std::vector<std::byte> pixels_;
  Duration budget_{-1};

  std::unique_ptr<flight::EventReader> events_;  ///< replaying
  mutable Instant last_{};
};

}  // namespace maplet::daemon
