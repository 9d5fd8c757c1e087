// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <tl/expected.hpp>

#include "core/base/arena.hpp"
#include "daemon/config.hpp"
#include "daemon/security_setup.hpp"
#include "transport/security/guard.hpp"

namespace maplet::daemon {

/// What `mapletctl status`, `peers` and `top` show of it.
struct SecurityStatus {
  bool on = false;
  bool in_dds = false;  ///< inside DDS Security, too
  Guard::State state = Guard::State::kGood;
  std::uint32_t generation = 0;
  Validity validity;
  Revoked revoked;
  GuardCounters counters;
  std::uint64_t proven = 0;  ///< sessions
  std::uint64_t notices_sent = 0;
  std::uint64_t refused_by_dds = 0;  ///< what DDS Security complained of
  std::uint64_t sealed_heard = 0;    ///< without keys: frames of those who have some
};
[[nodiscard]] nlohmann::ordered_json security_json(const SecurityStatus& status);

/// The guard of the daemon's link: its clock, its file, its words in the log.
///
/// Memory   the arena; what is kept on disk is made on the heap, when keys change.
/// Threads  one, the link's; load() and status() from any.
class LinkSecurity {
 public:
  /// @param setup  nothing: for its memory only
  LinkSecurity(const Config& config, const std::optional<SecuritySetup>& setup, Arena& arena);

  /// Why nothing can be said or heard now; empty: all is well.
  [[nodiscard]] std::string problem() const;

  [[nodiscard]] std::span<const std::byte> seal(std::span<const std::byte> datagram) noexcept;
  [[nodiscard]] std::span<const std::byte> open(std::span<const std::byte> frame,
                                                Instant now) noexcept;
  [[nodiscard]] std::span<const std::byte> next(Instant now) noexcept;
  [[nodiscard]] Instant due() const noexcept;
  [[nodiscard]] bool let_in() noexcept;
  /// At the clock, at what is to be kept and said. A few times a second.
  void look(Instant now) noexcept;

  /// Notices from the operator. @return what became of them, one line, or why not
  [[nodiscard]] tl::expected<std::string, std::string> load(const std::string& text) noexcept;
  /// Again from the folder that the configuration names.
  void reload();

  [[nodiscard]] SecurityStatus status() const;

 private:
  /// Where this agent stands, for a person; under the lock.
  [[nodiscard]] std::string standing() const;
  void keep();
  void say_state();
  void say_refused(Instant now);

  std::string keys_dir_;
  std::string kept_in_;
  std::int64_t tolerance_s_;
  bool in_dds_;
  mutable std::mutex mutex_;
  Guard guard_;
  std::uint64_t kept_ = 0;
  bool keeping_failed_ = false;
  std::optional<Guard::State> said_;
  bool said_soon_ = false;
  std::uint32_t said_generation_ = 0;
  std::uint64_t said_refused_ = 0;
  std::optional<Instant> refused_since_;
  Instant say_at_{};
  Duration say_every_ = std::chrono::seconds{10};
};

}  // namespace maplet::daemon
