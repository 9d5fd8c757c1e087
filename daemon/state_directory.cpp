// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/state_directory.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <utility>

#include "daemon/clear_mission.hpp"
#include "daemon/journal/format.hpp"

namespace maplet::daemon {

namespace fs = std::filesystem;
using journal::PosixFile;
using journal::Survey;

namespace {

constexpr int kMostDamaged = 9;  // stores that were set aside

std::string newer_version(const std::string& file) {
  return fmt::format(
      "--state: {} was written by a newer mapletd: it is left as it is; update mapletd, give "
      "another --state, or move the file away",
      file);
}

bool holds_anything(PosixFile& file) {
  std::array<std::byte, journal::kPageBytes> page;
  for (std::uint64_t at = 0; at < journal::kLookaheadPages * page.size(); at += page.size()) {
    const std::size_t bytes = file.read(at, page);
    const auto used = std::span{page}.first(bytes);
    if (std::ranges::any_of(used, [](std::byte b) { return b != std::byte{}; })) return true;
    if (bytes < page.size()) break;
  }
  return false;
}

Survey survey_of(PosixFile& file) {
  std::vector<std::byte> buffer(journal::kMaxTurnBytes);
  return journal::Reader{file, buffer}.survey();
}

}  // namespace

std::string describe(const journal::Damage& damage) {
  std::string text;
  const auto add = [&](const std::string& what) { text += (text.empty() ? "" : ", ") + what; };
  if (damage.mended_bits > 0) add(fmt::format("{} flipped bit(s) set right", damage.mended_bits));
  if (damage.turns > 0) add(fmt::format("{} damaged turn(s) dropped", damage.turns));
  if (damage.malformed > 0) add(fmt::format("{} turn(s) that make no sense", damage.malformed));
  if (damage.tail_bytes > 0)
    add(fmt::format("an unfinished write of {} bytes dropped", damage.tail_bytes));
  if (damage.missing_bytes > 0)
    add(fmt::format("the file is {} bytes too short", damage.missing_bytes));
  return text;
}

tl::expected<Survey, std::string> open_mission(const std::string& path, PosixFile& out) {
  if (const int error = out.open(path, false); error != 0) {
    return tl::unexpected{fmt::format("{}: {}", path, std::strerror(error))};
  }
  const Survey survey = survey_of(out);
  if (survey.state == Survey::State::kNewer) return tl::unexpected{newer_version(path)};
  if (survey.state == Survey::State::kEmpty)
    return tl::unexpected{fmt::format("{}: holds no mission", path)};
  return survey;
}

StateDirectory::StateDirectory(StateDirectory&& other) noexcept
    : mode_{other.mode_},
      path_{std::move(other.path_)},
      lock_fd_{std::exchange(other.lock_fd_, -1)},
      error_{other.error_},
      file_{std::move(other.file_)},
      survey_{other.survey_},
      took_{other.took_},
      said_{std::move(other.said_)},
      imported_{std::move(other.imported_)},
      problem_{std::move(other.problem_)} {}

StateDirectory& StateDirectory::operator=(StateDirectory&& other) noexcept {
  std::swap(mode_, other.mode_);
  std::swap(path_, other.path_);
  std::swap(lock_fd_, other.lock_fd_);
  std::swap(error_, other.error_);
  std::swap(file_, other.file_);
  std::swap(survey_, other.survey_);
  std::swap(took_, other.took_);
  std::swap(said_, other.said_);
  std::swap(imported_, other.imported_);
  std::swap(problem_, other.problem_);
  return *this;
}

StateDirectory::~StateDirectory() {
  if (lock_fd_ >= 0) close(lock_fd_);
}

void StateDirectory::fall_back(Mode mode, const std::string& why) {
  mode_ = mode;
  problem_ = why;
  said_.push_back(fmt::format("--state {}: {}; the mission goes on in memory", path_, why));
}

bool StateDirectory::lock() {
  const std::string file = path_ + "/" + kLockFile;
  lock_fd_ = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0640);
  if (lock_fd_ < 0) {
    error_ = errno;
    return true;  // a folder that nobody can write
  }
  if (flock(lock_fd_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) return false;
  // Somebody may have removed the lock of a daemon that runs: the mission itself is claimed, too.
  if (journal::is_claimed(path_ + "/" + kMissionFile)) return false;
  const std::string pid = std::to_string(getpid()) + "\n";
  if (ftruncate(lock_fd_, 0) != 0 || write(lock_fd_, pid.data(), pid.size()) < 0) error_ = errno;
  return true;
}

void StateDirectory::clear_if_asked() {
  if (lock_fd_ < 0 || !clear_is_asked(path_)) return;
  if (const std::string problem = remove_mission(path_); !problem.empty())
    said_.push_back(fmt::format("--state {}: not cleared: {}", path_, problem));
}

bool StateDirectory::open_file(bool write) {
  file_ = std::make_unique<PosixFile>();
  error_ = file_->open(path_ + "/" + kMissionFile, write);
  if (error_ == 0 && write && !file_->claim()) error_ = EBUSY;
  if (error_ != 0) file_.reset();
  return error_ == 0;
}

tl::expected<void, StateDirectory::Refusal> StateDirectory::look(std::uint16_t agent) {
  const std::string file = path_ + "/" + kMissionFile;
  const MonotonicClock clock;
  const Instant begin = clock.now();
  survey_ = survey_of(*file_);
  took_ = clock.now() - begin;
  if (survey_.state == Survey::State::kNewer) {
    return tl::unexpected{Refusal{newer_version(file), true}};
  }
  if (survey_.state == Survey::State::kGood && survey_.life.agent != agent) {
    return tl::unexpected{Refusal{
        fmt::format(
            "--state: {} is the mission of agent {}, and this is agent {}: it is left as it "
            "is; give --agent {}, another --state, or take it in with mapletctl mission "
            "import",
            file, survey_.life.agent, agent, survey_.life.agent),
        true}};
  }
  if (const std::string damage = describe(survey_.damage); !damage.empty())
    said_.push_back(fmt::format("{}: {}", file, damage));
  return {};
}

// What was set aside earlier stays: the first is the one with the most in it.
void StateDirectory::set_aside() {
  const std::string file = path_ + "/" + kMissionFile;
  std::string aside = file + ".damaged";
  for (int i = 2; i <= kMostDamaged && fs::exists(fs::symlink_status(aside)); ++i)
    aside = fmt::format("{}.damaged.{}", file, i);
  file_.reset();
  std::error_code error;
  fs::rename(file, aside, error);
  if (error) {
    error_ = error.value();
    return;
  }
  said_.push_back(fmt::format(
      "{}: no turn of it can be read: it is now {}, and a new mission begins", file, aside));
  (void)open_file(true);
}

void StateDirectory::make_room(std::uint64_t bytes) {
  const bool fresh = !holds_mission();
  if (!fresh) bytes = 2 * std::uint64_t{survey_.half_pages} * journal::kPageBytes;
  const int error = file_->reserve(bytes);
  if (error == 0) {
    survey_.half_pages =
        fresh ? static_cast<std::uint32_t>(bytes / 2 / journal::kPageBytes) : survey_.half_pages;
    (void)journal::flush_folder(path_);
    mode_ = Mode::kJournal;
    return;
  }
  if (fresh) {
    file_.reset();
    std::error_code ignored;
    fs::remove(path_ + "/" + kMissionFile, ignored);
  }
  fall_back(fresh ? Mode::kMemory : Mode::kReadOnly,
            fmt::format("no room for {} MiB ({})", bytes >> 20, std::strerror(error)));
}

void StateDirectory::list_imported() {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator{path_, error}) {
    if (entry.path().extension() == kImportSuffix) imported_.push_back(entry.path().string());
  }
  std::ranges::sort(imported_);
}

namespace {

tl::unexpected<StateDirectory::Refusal> in_use(const std::string& path) {
  return tl::unexpected{StateDirectory::Refusal{
      fmt::format("--state {}: another mapletd works with it: stop that one, or give another "
                  "--state",
                  path),
      false}};
}

}  // namespace

tl::expected<StateDirectory, StateDirectory::Refusal> StateDirectory::open(const std::string& path,
                                                                           std::uint16_t agent,
                                                                           std::uint64_t bytes) {
  StateDirectory state{path};
  if (path.empty()) return state;
  std::error_code error;
  fs::create_directories(path, error);
  if (error && !fs::is_directory(path)) {
    state.fall_back(Mode::kMemory, error.message());
    return state;
  }
  if (!state.lock()) return in_use(path);
  state.clear_if_asked();
  state.list_imported();
  const int no_lock = state.lock_fd_ < 0 ? state.error_ : 0;
  const bool writable = no_lock == 0 && state.open_file(true);
  const std::string why = no_lock != 0
                              ? fmt::format("{}: {}", kLockFile, std::strerror(no_lock))
                              : fmt::format("{}: {}", kMissionFile, std::strerror(state.error_));
  if (no_lock == 0 && !writable && state.error_ == EBUSY) return in_use(path);
  if (!writable && !state.open_file(false)) {
    state.fall_back(Mode::kMemory, why);
    return state;
  }
  if (const auto looked = state.look(agent); !looked) return tl::unexpected{looked.error()};
  if (!writable) {
    state.fall_back(Mode::kReadOnly, why);
    return state;
  }
  if (!state.holds_mission() && holds_anything(*state.file_)) state.set_aside();
  if (state.file_) {
    state.make_room(bytes);
  } else {
    state.fall_back(Mode::kMemory,
                    fmt::format("{}: {}", kMissionFile, std::strerror(state.error_)));
  }
  return state;
}

}  // namespace maplet::daemon
