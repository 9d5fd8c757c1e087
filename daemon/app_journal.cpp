// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The mission on disk: where the run goes on, and what is written down of it.
#include <algorithm>
#include <array>
#include <chrono>

#include "daemon/app.hpp"
#include "daemon/log.hpp"
#include "daemon/resume.hpp"

namespace maplet::daemon {

namespace {

using namespace std::chrono_literals;

constexpr Duration kSnapshots = 10min;
constexpr Duration kPieces = 45s;                 // of one
constexpr std::size_t kPieceNodes = 48;           // with the turn's head it fits a page
constexpr std::size_t kSnapshotAtEnd = 8 * 1024;  // bytes: a larger one is left as it was

}  // namespace

JournalWriter::Config journal_config(const Config& config) {
  const LimitsConfig& limits = config.agent.limits;
  const auto maplets = static_cast<std::size_t>(limits.own_maplets);
  const auto half = static_cast<std::size_t>(config.journal.size_mib) << 19;
  const std::size_t expected = std::min(static_cast<std::size_t>(config.agent.maplet.max_bytes),
                                        limits.expected_maplet_bytes());
  // A quarter of a half at most is carried over when the halves change.
  return {config.journal.queue_bytes(),
          {maplets, std::min(maplets * expected, half / 4),
           std::min(static_cast<std::size_t>(config.exchange.records_kept), half / 8 / 128)}};
}

void App::open_journal() {
  for (const std::string& line : state_.said()) log_warning(line);
  snapshot_at_ = machine_.now();
  if (state_.mode() == StateDirectory::Mode::kJournal) {
    journal_ = std::make_unique<JournalWriter>(*state_.file(), state_.survey(),
                                               Life{identity_.agent, identity_.epoch},
                                               journal_config(config_), arena_);
  }
}

void App::resume_mission() {
  if (replayed_) {
    if (!replayed_->resumed) return;
    if (const auto first = resume_again(flight_, *agent_, records_)) agent_->begin_part(*first);
    return;
  }
  if (!state_.holds_mission() && state_.imported().empty()) {
    if (journal_) journal_->put(journal::Part{0, wall_clock_s()});
    return;
  }
  flight_.wait_for_disk(true);  // a mission is recorded whole
  const Resumed resumed = resume(state_, *agent_, radio_.get(), flight_,
                                 static_cast<std::size_t>(config_.agent.limits.own_maplets));
  log_info(to_line(resumed));
  auto ends = state_.survey().ends;
  if (journal_ == nullptr || !state_.holds_mission()) ends = {};  // a new life
  records_.go_on(ends);
  const std::uint32_t first = ends[static_cast<std::size_t>(Stream::kMaplets)];
  agent_->begin_part(first);
  if (flight_.recording()) flight_.note_restored(ends);
  flight_.wait_for_disk(pace_ == Pace::kFast);
  for (std::size_t i = 0; radio_ && i < kStreams; ++i)
    radio_->restored(static_cast<Stream>(i), ends[i]);
  if (journal_) journal_->put(journal::Part{first, wall_clock_s()});
}

std::int64_t App::wall_clock_s() {
  return std::chrono::duration_cast<std::chrono::seconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

// A piece at a time: a snapshot costs no more than what may be written while nothing is found out.
void App::note_skeleton(bool all) {
  if (!journal_) return;
  const Skeleton& skeleton = agent_->skeleton();
  const Instant now = machine_.now();  // nothing that a replay has to know
  if (all || snapshot_next_ < 0) {
    const bool small =
        static_cast<std::size_t>(skeleton.node_count()) * sizeof(journal::NodePose) <=
        kSnapshotAtEnd;
    const bool due = all ? small : now - snapshot_at_ > kSnapshots;
    const bool same = snapshot_next_ < 0 && skeleton.records_digest() == snapshot_digest_;
    if (!due || skeleton.node_count() == 0 || same) return;
    snapshot_at_ = now;
    snapshot_digest_ = skeleton.records_digest();
    snapshot_next_ = 0;
  } else if (now - piece_at_ < kPieces) {
    return;
  }
  piece_at_ = now;
  do {
    static_assert(kPieceNodes <= journal::Poses::kMost);
    std::array<journal::NodePose, kPieceNodes> poses;
    std::size_t count = 0;
    const bool first = snapshot_next_ == 0;
    for (; count < poses.size() && snapshot_next_ < skeleton.node_count(); ++count) {
      const Skeleton::NodeView node = skeleton.node(snapshot_next_++);
      poses[count] = {node.key, node.gauge, node.T_world_maplet};
    }
    journal_->put(journal::Poses{snapshot_digest_, first, std::span{poses}.first(count)});
    if (snapshot_next_ >= skeleton.node_count()) snapshot_next_ = -1;
  } while (all && snapshot_next_ >= 0);
}

void App::close_journal() {
  constexpr Duration kPatience = 3s;
  if (!journal_) return;
  note_skeleton(true);
  if (!journal_->drain(kPatience))
    log_warning("the journal's disk did not take everything in time");
}

}  // namespace maplet::daemon
