// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The end of a run: the last maplet, the files, the report, the picture.
#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "daemon/app.hpp"
#include "daemon/log.hpp"
#include "daemon/mapletctl_call.hpp"
#include "daemon/mounting.hpp"
#include "daemon/report.hpp"

namespace maplet::daemon {

namespace {

constexpr Duration kFlushTime = std::chrono::seconds{3};
constexpr Duration kServiceFlushTime = std::chrono::milliseconds{300};  // it ends within 1 s

/// A source's URI without its query, and of a path only its last part: "sim:loop", "redkitchen_a".
std::string short_name(const std::string& uri) {
  std::string name = uri.substr(0, uri.find('?'));
  if (name.starts_with("tum:")) name = std::filesystem::weakly_canonical(name.substr(4)).string();
  while (name.size() > 1 && name.back() == '/') name.pop_back();
  const auto slash = name.find_last_of('/');
  return slash == std::string::npos ? name : name.substr(slash + 1);
}

}  // namespace

// While others are heard. A replay listens as often.
void App::linger() {
  if (!linked() || !finite()) return;
  if (radio_) {
    radio_->linger(config_.exchange.linger, [this] {
      flight_.note_mark();
      listen(kMeetings);
    });
  }
  while (flight_.take(flight::Event::kMark)) listen(kMeetings);
}

int App::finish() {
  if (const MapletCut* closed = agent_->finish(Deadline::never())) {
    totals_.add(*closed);
    hand_out(closed);
  }
  publish_status(StatusRecord::State::kStopping);
  close_journal();
  linger();
  const Duration patience = output_ ? kFlushTime : kServiceFlushTime;
  if (publisher_ && publisher_->open() && !publisher_->flush(patience)) {
    log_warning("a subscriber did not take everything in time");
  }
  if (output_) (void)agent_->settle(Deadline::never());
  if (neighbours_) neighbours_->finish(*agent_, patience);
  if (!output_) return kExitDone;
  close_journal();
  totals_.unrelated = records_.refused();
  if (totals_.processed == 0) {
    log_error(config_.input.source + ": no usable frame; check the recording");
    return kExitFailure;
  }
  if (totals_.maplets == 0) {
    (void)write_report();
    log_error(
        fmt::format("{}: none of {} frames could be tracked, so there is no map; check depth "
                    "unit and intrinsics (mapletctl patches SOURCE --draw shows what is seen)",
                    config_.input.source, totals_.processed));
    return kExitFailure;
  }
  if (const auto written = output_->finish(*agent_); !written) {
    log_error(written.error());
    return kExitFailure;
  }
  say_notable();
  // The picture tells figures of the report.
  return write_report() && draw() ? kExitDone : kExitFailure;
}

/// What a person should know of a run that ended well.
void App::say_notable() const {
  if (totals_.partly_free > 0) {
    log_warning(fmt::format(
        "{}: in {} of {} frames nothing was seen along some direction; the pose "
        "along it is the prediction's, known to {:.2g} m",
        config_.input.source, totals_.partly_free, totals_.processed, totals_.free.sigma_m));
  }
  if (const Line doubt = plane_doubt(agent_->plane()); !view(doubt).empty()) {
    log_warning(fmt::format("{}: {}", config_.input.source, view(doubt)));
  }
  const SourceCounters counted = source_counters();
  if (counted.unreadable + counted.out_of_order == 0) return;
  log_warning(
      fmt::format("{}: {} images could not be read, {} frames were out of order; {} frames "
                  "were read",
                  config_.input.source, counted.unreadable, counted.out_of_order, counted.read));
}

/// In a run without an end: once.
void App::say_plane() {
  const Line doubt = plane_doubt(agent_->plane());
  if (view(doubt).empty()) return;
  plane_doubted_ = true;
  warnings_.say(view(doubt));
}

bool App::draw() {
  // The headline is the source's, not the folder's: two runs give the same bytes.
  std::vector<std::string> arguments{
      "draw", output_->folder().string(), "--title",
      "Map of " + short_name(replayed_ ? replayed_->source : config_.input.source)};
  if (const auto& up = config_.body.up) {
    arguments.insert(arguments.end(),
                     {"--up", fmt::format("{},{},{}", (*up)[0], (*up)[1], (*up)[2])});
  }
  const std::string problem = call_mapletctl(arguments);
  if (!problem.empty()) log_error(problem);
  return problem.empty();
}

bool App::write_report() {
  const auto path = output_->folder() / "report.json";
  std::ofstream file{path};
  const auto radio = radio_ ? std::make_unique<RadioStatus>(radio_->status()) : nullptr;
  file << report_json(totals_, source_counters(), meters_, arena_.used_bytes(), radio.get(),
                      *agent_);
  file.close();
  if (!file) log_error(path.string() + ": cannot be written; make room and run again");
  return static_cast<bool>(file);
}

}  // namespace maplet::daemon
