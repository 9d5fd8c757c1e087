// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "core/base/clock.hpp"
#include "daemon/journal/posix_file.hpp"
#include "daemon/journal/reader.hpp"

namespace maplet::daemon {

inline constexpr const char* kMissionFile = "mission.journal";
inline constexpr const char* kLockFile = "lock";
inline constexpr const char* kImportSuffix = ".imported";

/// A daemon's folder on disk, and the mission in it: who may write it, and what is there.
///
/// Memory   allocates; start-up and mapletctl only.
class StateDirectory {
 public:
  enum class Mode : std::uint8_t {
    kNone,      ///< no folder: no journal
    kJournal,   ///< ours to write
    kReadOnly,  ///< what is there is read; the mission goes on in memory
    kMemory,    ///< of no use
  };
  /// Why the daemon does not start on it.
  struct Refusal {
    std::string what;
    bool usage = false;  ///< else the environment's
  };

  /// @param path      empty: none
  /// @param bytes     of the file, when one is made
  [[nodiscard]] static tl::expected<StateDirectory, Refusal> open(const std::string& path,
                                                                  std::uint16_t agent,
                                                                  std::uint64_t bytes);
  StateDirectory(StateDirectory&&) noexcept;
  StateDirectory& operator=(StateDirectory&&) noexcept;
  ~StateDirectory();

  [[nodiscard]] Mode mode() const noexcept { return mode_; }
  [[nodiscard]] const std::string& path() const noexcept { return path_; }
  /// Why it is not ours to write; what damage was found. One line each.
  [[nodiscard]] const std::vector<std::string>& said() const noexcept { return said_; }
  /// Why there is no journal although a folder was given; empty: there is one.
  [[nodiscard]] const std::string& problem() const noexcept { return problem_; }
  [[nodiscard]] const journal::Survey& survey() const noexcept { return survey_; }
  [[nodiscard]] bool holds_mission() const noexcept {
    return survey_.state == journal::Survey::State::kGood;
  }
  /// nullptr: nothing to read or write
  [[nodiscard]] journal::PosixFile* file() noexcept { return file_.get(); }
  /// How long it took to read what is there.
  [[nodiscard]] Duration took() const noexcept { return took_; }
  /// Missions that were imported: read-only files.
  [[nodiscard]] const std::vector<std::string>& imported() const noexcept { return imported_; }

 private:
  explicit StateDirectory(std::string path) : path_{std::move(path)} {}
  /// @return false: another process has it
  [[nodiscard]] bool lock();
  void clear_if_asked();
  [[nodiscard]] bool open_file(bool write);
  [[nodiscard]] tl::expected<void, Refusal> look(std::uint16_t agent);
  void make_room(std::uint64_t bytes);
  void set_aside();
  void list_imported();
  void fall_back(Mode mode, const std::string& why);

  Mode mode_ = Mode::kNone;
  std::string path_;
  int lock_fd_ = -1;
  int error_ = 0;
  std::unique_ptr<journal::PosixFile> file_;
  journal::Survey survey_;
  Duration took_{};
  std::vector<std::string> said_;
  std::vector<std::string> imported_;
  std::string problem_;
};

/// What a person is told of damage; empty: there is none.
[[nodiscard]] std::string describe(const journal::Damage& damage);

/// The mission in a file, for reading only. @return why there is none
[[nodiscard]] tl::expected<journal::Survey, std::string> open_mission(const std::string& file,
                                                                      journal::PosixFile& out);

}  // namespace maplet::daemon
