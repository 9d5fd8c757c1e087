// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/resume.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "daemon/journal/reader.hpp"
#include "daemon/log.hpp"

namespace maplet::daemon {

namespace {

using journal::Visitor;

/// How many maplets there are: the oldest ones may be too many.
struct Count final : Visitor {
  std::size_t maplets = 0;
  void take(const MapletKey&, float, std::span<const std::byte>) noexcept override { ++maplets; }
};

/// Takes what earlier runs left into the estimate.
class Inlet {
 public:
  explicit Inlet(Agent& agent) noexcept : agent_{agent} {}

  template <class Record>
  void take(const Record& record) noexcept {
    // Its place in the estimate is worked at later, beside the frames.
    (void)agent_.hear(maplet::restore(record), Deadline{clock_, Duration{0}});
  }
  [[nodiscard]] bool take(const MapletKey& key, std::span<const std::byte> bytes) noexcept {
    const AgentIdentity& self = agent_.identity();
    const bool own = key.agent == self.agent && key.epoch == self.epoch;
    return own ? agent_.restore(key, bytes) : agent_.hear(key, bytes);
  }
  void take(const journal::Decision& d) noexcept {
    (void)agent_.decide(d.a, d.b, d.accept, Deadline{clock_, Duration{0}});
  }

 private:
  Agent& agent_;
  ManualClock clock_;
};

class Restorer final : public Visitor {
 public:
  Restorer(Agent& agent, RadioLink* radio, FlightLog& flight, std::size_t skip,
           Resumed& resumed) noexcept
      : inlet_{agent}, radio_{radio}, flight_{flight}, skip_{skip}, resumed_{resumed} {}

  void take(const DeltaPoseRecord& record) noexcept override { take_record(record); }
  void take(const RangeRecord& record) noexcept override { take_record(record); }
  void take(const MapletKey& key, float saliency,
            std::span<const std::byte> bytes) noexcept override {
    if (skip_ > 0) {
      --skip_;
      return;
    }
    if (flight_.recording()) flight_.note(key, bytes);
    if (!inlet_.take(key, bytes)) return;
    if (radio_ != nullptr) radio_->restore(key, bytes, saliency);
    ++resumed_.maplets;
  }
  void take(const journal::Part&) noexcept override { ++resumed_.parts; }
  void take(const journal::Decision& decision) noexcept override { decisions_.push_back(decision); }

  /// An operator's verdicts, once the closures are there.
  void decide() noexcept {
    for (const journal::Decision& d : decisions_) {
      if (flight_.recording()) flight_.decided(d.a, d.b, d.accept);
      inlet_.take(d);
    }
  }

 private:
  template <class Record>
  void take_record(const Record& record) noexcept {
    if (flight_.recording()) flight_.note(record);
    inlet_.take(record);
    if (radio_ != nullptr) radio_->restore(record);
    ++resumed_.records;
  }

  Inlet inlet_;
  RadioLink* radio_;
  FlightLog& flight_;
  std::size_t skip_;
  Resumed& resumed_;
  std::vector<journal::Decision> decisions_;
};

void take_in(journal::PosixFile& file, const journal::Survey& survey, Agent& agent,
             RadioLink* radio, FlightLog& flight, std::size_t most_maplets, Resumed& resumed) {
  std::vector<std::byte> buffer(journal::kMaxTurnBytes);
  journal::Reader reader{file, buffer};
  Count count;
  reader.read(survey, count);
  Restorer restorer{agent, radio, flight, count.maplets - std::min(count.maplets, most_maplets),
                    resumed};
  reader.read(survey, restorer);
  restorer.decide();
}

}  // namespace

Resumed resume(StateDirectory& state, Agent& agent, RadioLink* radio, FlightLog& flight,
               std::size_t own_maplets) {
  const MonotonicClock clock;
  const Instant begin = clock.now();
  Resumed resumed;
  if (state.holds_mission() && state.file() != nullptr)
    take_in(*state.file(), state.survey(), agent, radio, flight, own_maplets, resumed);
  for (const std::string& path : state.imported()) {
    journal::PosixFile file;
    const auto survey = open_mission(path, file);
    if (!survey) {
      log_warning(survey.error());
      continue;
    }
    if (state.holds_mission() && survey->life == state.survey().life) continue;  // an older copy
    take_in(file, *survey, agent, radio, flight, own_maplets, resumed);
    ++resumed.imported;
  }
  resumed.took = state.took() + (clock.now() - begin);
  return resumed;
}

std::optional<std::uint32_t> resume_again(FlightLog& flight, Agent& agent, OwnRecords& records) {
  Inlet inlet{agent};
  std::vector<std::byte> bytes(kMaxMapletBytes);
  DeltaPoseRecord delta;
  RangeRecord range;
  journal::Decision decision;
  std::array<std::uint32_t, kStreams> ends{};
  while (!flight.over()) {
    MapletKey key;
    if (flight.replayed_restored(ends)) {
      records.go_on(ends);
      return ends[static_cast<std::size_t>(Stream::kMaplets)];
    }
    if (flight.replayed(delta)) {
      inlet.take(delta);
    } else if (flight.replayed(range)) {
      inlet.take(range);
    } else if (const std::size_t size = flight.replayed_maplet(key, bytes)) {
      (void)inlet.take(key, std::span{bytes}.first(size));
    } else if (flight.replayed_decision(decision.a, decision.b, decision.accept)) {
      inlet.take(decision);
    } else {
      break;
    }
  }
  return {};
}

std::string to_line(const Resumed& r) {
  std::string line = fmt::format("resumed {} maplet(s) and {} record(s) of {} earlier start(s)",
                                 r.maplets, r.records, r.parts);
  if (r.imported > 0) line += fmt::format(" and {} imported mission(s)", r.imported);
  return line + fmt::format(" in {:.0f} ms", seconds(r.took) * 1e3);
}

}  // namespace maplet::daemon
