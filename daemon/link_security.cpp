// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/link_security.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <nlohmann/json.hpp>

#include "daemon/log.hpp"

namespace maplet::daemon {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::int64_t kSoon_s = 7 * 86400;  // keys that end within are warned of
constexpr Duration kIntroduction = std::chrono::seconds{20};
constexpr Duration kSeldom = std::chrono::hours{1};

std::int64_t wall_clock_s() noexcept { return std::time(nullptr); }

std::string refused_line(const GuardCounters& counters) {
  std::string parts;
  for (std::size_t i = 0; i < kRefusals; ++i) {
    if (counters.refused[i] == 0) continue;
    parts += fmt::format("{}{} {}", parts.empty() ? "" : ", ", counters.refused[i],
                         to_string(static_cast<Refusal>(i)));
  }
  return parts;
}

constexpr const char* kStates[] = {"good", "not_yet_valid", "expired", "revoked"};

}  // namespace

nlohmann::ordered_json security_json(const SecurityStatus& status) {
  if (!status.on) return {{"mode", "off"}, {"sealed_heard", status.sealed_heard}};
  Json refused = Json::object();
  for (std::size_t i = 0; i < kRefusals; ++i) {
    refused[std::string{to_string(static_cast<Refusal>(i))}] = status.counters.refused[i];
  }
  refused["by_dds"] = status.refused_by_dds;
  return {
      {"mode", status.in_dds ? "dds" : "sealed"},
      {"state", kStates[static_cast<std::size_t>(status.state)]},
      {"generation", status.generation},
      {"not_before", utc(status.validity.not_before_s)},
      {"not_after", utc(status.validity.not_after_s)},
      {"revoked", std::vector<std::uint16_t>(status.revoked.begin(), status.revoked.end())},
      {"sealed", status.counters.sealed},
      {"opened", status.counters.opened},
      {"proven", status.proven},
      {"talk_sent", status.counters.talk_sent},
      {"notices_sent", status.notices_sent},
      {"refused", refused},
      {"refused_in_all", status.counters.all_refused() + status.refused_by_dds},
      {"last_refused_agent", status.counters.all_refused() > 0 ? status.counters.last_agent : -1}};
}

LinkSecurity::LinkSecurity(const Config& config, const std::optional<SecuritySetup>& setup,
                           Arena& arena)
    : keys_dir_{config.security.keys},
      kept_in_{setup ? setup->kept_in : std::string{}},
      tolerance_s_{config.security.clock_tolerance_s},
      in_dds_{config.security.in_dds()},
      guard_{{config.security.clock_tolerance_s, config.radio.link_profile().quick,
              static_cast<std::size_t>(config.exchange.max_lives)},
             setup ? setup->keys : AgentKeys{},
             arena} {
  guard_.set_wall_clock(wall_clock_s());
  if (!setup) return;
  for (const Bytes& notice : setup->kept) (void)guard_.take_notice(notice, Instant{});
  kept_ = guard_.board().changes();
  for (const Bytes& notice : setup->beside) (void)guard_.take_notice(notice, Instant{});
  said_generation_ = guard_.keys().generation;
}

std::string LinkSecurity::problem() const {
  const std::scoped_lock lock{mutex_};
  if (guard_.state() == Guard::State::kRevoked) {
    return fmt::format(
        "security: the operator has revoked the keys of agent {}: nothing is said "
        "or heard; a robot that is back gets another number: mapletctl keys agent",
        guard_.keys().agent);
  }
  const std::string dates = maplet::problem(guard_.keys().validity, wall_clock_s(), tolerance_s_);
  return dates.empty() ? "" : "security: the keys in " + keys_dir_ + " are " + dates;
}

std::span<const std::byte> LinkSecurity::seal(std::span<const std::byte> datagram) noexcept {
  const std::scoped_lock lock{mutex_};
  return guard_.seal(datagram);
}
std::span<const std::byte> LinkSecurity::open(std::span<const std::byte> frame,
                                              Instant now) noexcept {
  const std::scoped_lock lock{mutex_};
  return guard_.open(frame, now);
}
std::span<const std::byte> LinkSecurity::next(Instant now) noexcept {
  const std::scoped_lock lock{mutex_};
  return guard_.next(now);
}
Instant LinkSecurity::due() const noexcept {
  const std::scoped_lock lock{mutex_};
  return guard_.due();
}
bool LinkSecurity::let_in() noexcept {
  const std::scoped_lock lock{mutex_};
  return guard_.let_in();
}

void LinkSecurity::look(Instant now) noexcept {
  {
    const std::scoped_lock lock{mutex_};
    guard_.set_wall_clock(wall_clock_s());
  }
  keep();
  say_state();
  say_refused(now);
}

void LinkSecurity::keep() {
  std::string text;
  {
    const std::scoped_lock lock{mutex_};
    const NoticeBoard& board = guard_.board();
    if (board.changes() == kept_) return;
    kept_ = board.changes();
    for (std::size_t i = 0; i < board.parts(); ++i) {
      if (!board.part(i).empty()) text += notice_text(board.part(i));
    }
  }
  const std::string problem = write_file(kept_in_, text, 0600);
  if (!problem.empty() && !keeping_failed_) {
    log_warning("security: " + problem +
                ": new keys are not kept; after a restart they come from another agent");
  }
  keeping_failed_ = !problem.empty();
}

void LinkSecurity::say_state() {
  Guard::State state{};
  std::uint32_t generation = 0;
  Validity validity;
  {
    const std::scoped_lock lock{mutex_};
    state = guard_.state();
    generation = guard_.keys().generation;
    validity = guard_.keys().validity;
  }
  if (state != said_) {
    if (state != Guard::State::kGood) {
      log_warning(problem());
    } else if (said_) {
      log_info("security: the keys are good again");
    }
    said_ = state;
  }
  if (generation != said_generation_) {
    log_info(fmt::format("security: keys of generation {} until {}", generation,
                         utc(validity.not_after_s)));
    said_generation_ = generation;
    said_soon_ = false;
  }
  if (state == Guard::State::kGood && !said_soon_ &&
      validity.not_after_s - wall_clock_s() < kSoon_s) {
    log_warning(fmt::format("security: the keys end at {}: mapletctl keys rotate makes the next",
                            utc(validity.not_after_s)));
    said_soon_ = true;
  }
}

// Once soon, then ever more seldom while it goes on. Not at once: the first frames of a friend are
// taken off again.
void LinkSecurity::say_refused(Instant now) {
  const SecurityStatus status = this->status();
  const std::uint64_t all = status.counters.all_refused();
  if (all <= said_refused_) {
    refused_since_.reset();
    return;
  }
  if (!refused_since_) refused_since_ = now;
  if (now - *refused_since_ < kIntroduction || now < say_at_) return;
  if (now - say_at_ > kSeldom) say_every_ = std::chrono::seconds{10};
  const int agent = status.counters.last_agent;
  log_warning(fmt::format("security: {} frames were refused ({}){}", all,
                          refused_line(status.counters),
                          agent < 0 ? "" : fmt::format(", the last as from agent {}", agent)));
  said_refused_ = all;
  say_at_ = now + say_every_;
  say_every_ = std::min<Duration>(2 * say_every_, kSeldom);
}

std::string LinkSecurity::standing() const {
  const AgentKeys& keys = guard_.keys();
  const std::uint32_t told = guard_.board().generation();
  if (guard_.state() == Guard::State::kRevoked) {
    return fmt::format("generation {} revokes the keys of agent {}", told, keys.agent);
  }
  if (told > keys.generation) {
    return fmt::format("generation {}, and no key of it for agent {} yet", told, keys.agent);
  }
  return fmt::format("keys of generation {}", keys.generation);
}

tl::expected<std::string, std::string> LinkSecurity::load(const std::string& text) noexcept {
  const auto notices = notices_in(text);
  if (notices.empty()) return tl::unexpected<std::string>{"no key notice in it"};
  const MonotonicClock clock;
  Guard::Taken best = Guard::Taken::kForged;
  const std::scoped_lock lock{mutex_};
  for (const Bytes& notice : notices) {
    best = std::min(best, guard_.take_notice(notice, clock.now()));
  }
  switch (best) {
    case Guard::Taken::kNew:
      return "taken: " + standing();
    case Guard::Taken::kKnown:
      return "known: " + standing();
    case Guard::Taken::kOld:
      return tl::unexpected{
          fmt::format("an old notice: generation {} is in use",
                      std::max(guard_.keys().generation, guard_.board().generation()))};
    case Guard::Taken::kNoSense:
      return tl::unexpected<std::string>{"the notice is damaged"};
    case Guard::Taken::kForeign:
      return tl::unexpected<std::string>{"the notice is another team's"};
    case Guard::Taken::kForged:
      break;
  }
  return tl::unexpected<std::string>{"the notice is not signed by this team's operator"};
}

void LinkSecurity::reload() {
  const std::string path = keys_dir_ + "/" + kNoticeFile;
  AgentKeys keys;
  {
    const std::scoped_lock lock{mutex_};
    keys = guard_.keys();
  }
  const auto notices = load_notices(path, keys);
  if (!notices) {
    log_warning("security: " + notices.error());
    return;
  }
  std::string text;
  for (const Bytes& notice : *notices) text += notice_text(notice);
  if (text.empty()) return;
  const auto done = load(text);
  log_info("security: " + path + ": " + (done ? *done : done.error()));
}

SecurityStatus LinkSecurity::status() const {
  const std::scoped_lock lock{mutex_};
  SecurityStatus status;
  status.on = true;
  status.in_dds = in_dds_;
  status.state = guard_.state();
  status.generation = guard_.keys().generation;
  status.validity = guard_.keys().validity;
  status.revoked = guard_.keys().revoked;
  status.counters = guard_.counters();
  status.proven = static_cast<std::uint64_t>(
      std::ranges::count(guard_.sessions().all(), Session::State::kProven, &Session::state));
  status.notices_sent = guard_.board().sent();
  return status;
}

}  // namespace maplet::daemon
