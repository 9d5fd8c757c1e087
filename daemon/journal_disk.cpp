// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The journal's disk, as the writer meets it, and what is said of it.
#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "daemon/alloc_counter.hpp"
#include "daemon/journal_writer.hpp"
#include "daemon/log.hpp"

namespace maplet::daemon {

using journal::BlockFile;

namespace {

using namespace std::chrono_literals;

constexpr Duration kRetry = 2s;
constexpr Duration kLooks = 2s;  // for the file's name

}  // namespace

void JournalWriter::look_for_file(Instant now) noexcept {
  if (removed_ || now < look_at_) return;
  look_at_ = now + kLooks;
  const BlockFile::Place place = file_.place();
  removed_ = place == BlockFile::Place::kRemoved;
  const bool was_moved = std::exchange(moved_, place == BlockFile::Place::kElsewhere);
  const ThirdPartyScope rare;
  if (removed_) {
    good_ = true;  // nobody waits for it
    log_error(
        "the journal's file was removed: the mission goes on in memory; the next start begins "
        "another one");
  } else if (moved_ && !was_moved) {
    log_error(
        "the journal's file was moved: the mission goes on in it where it is now, and nothing is "
        "acknowledged until it is back; a start that does not find it begins another mission");
  } else if (was_moved && !moved_) {
    log_info("the journal's file is back");
  }
}

void JournalWriter::refused(Instant now) noexcept {
  if (good_) {
    const ThirdPartyScope rare;  // text
    log_warning(
        fmt::format("the journal cannot be written ({}): own records wait, off the air, and "
                    "it is tried again",
                    std::strerror(file_.error())));
  }
  good_ = false;
  retry_at_ = now + kRetry;
}

void JournalWriter::note() noexcept {
  const bool given_up = given_up_;
  const std::scoped_lock lock{mutex_};
  if (given_up && !std::exchange(said_given_up_, true)) {
    const ThirdPartyScope rare;
    log_error(
        "the journal is given up: too much waits for the disk; the mission goes on in memory, and "
        "what is found out from now on stays off the air until a restart");
  }
  status_.state = removed_   ? JournalStatus::State::kRemoved
                  : given_up ? JournalStatus::State::kGivenUp
                  : !good_   ? JournalStatus::State::kWaiting
                  : moved_   ? JournalStatus::State::kMoved
                             : JournalStatus::State::kOn;
  status_.error = removed_ ? ENOENT : !good_ ? file_.error() : moved_ ? ENOENT : 0;
  status_.flushed = acknowledged();
  status_.written_bytes = store_.bytes_written();
  status_.carried_bytes = store_.bytes_carried();
  status_.generation = store_.generation();
  status_.waiting_bytes = queue_.read_available() + turn_.payload_bytes();
  status_.held_back = held_back_;
  status_.heard_dropped = heard_dropped_;
}

JournalStatus JournalWriter::status() const {
  const std::scoped_lock lock{mutex_};
  return status_;
}

}  // namespace maplet::daemon
