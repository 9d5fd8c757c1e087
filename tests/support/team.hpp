// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "transport/security/guard.hpp"

namespace maplet::test {

/// An operator and the keys of a team, without files.
struct Team {
  static constexpr std::int64_t kNow = 1'800'000'000;

  Team() {
    fill_random(operator_key.bytes());
    fill_random(group.bytes());
  }

  AgentKeys keys(std::uint16_t agent) {
    AgentKeys keys;
    keys.operator_key = verifying_key(operator_key);
    keys.agent = agent;
    keys.generation = generation;
    keys.validity = validity;
    fill_random(keys.own.bytes());
    keys.group = group;
    robots.emplace_back(agent, exchange_public(keys.own));
    return keys;
  }

  /// The next generation, without `gone`.
  std::vector<std::vector<std::byte>> rotate(const std::vector<std::uint16_t>& gone = {}) {
    ++generation;
    fill_random(group.bytes());
    ExchangeKey passing;
    fill_random(passing.bytes());
    for (const std::uint16_t agent : gone) {
      revoked.push_back(agent);
      std::erase_if(robots, [&](const auto& robot) { return robot.first == agent; });
    }
    const std::size_t most = sealed_in_a_part(revoked.size());
    const std::size_t parts = std::max<std::size_t>(1, (robots.size() + most - 1) / most);
    std::vector<std::vector<std::byte>> all;
    for (std::size_t part = 0; part < parts; ++part) {
      KeyNotice notice;
      notice.team = team_of(verifying_key(operator_key));
      notice.generation = generation;
      notice.part = static_cast<std::uint8_t>(part);
      notice.parts = static_cast<std::uint8_t>(parts);
      notice.validity = validity;
      notice.passing = exchange_public(passing);
      notice.revoked = revoked;
      for (std::size_t i = part * most; i < std::min((part + 1) * most, robots.size()); ++i) {
        notice.sealed.push_back(
            seal_for(robots[i].first, robots[i].second, passing, generation, group));
      }
      all.push_back(to_bytes(notice, operator_key));
    }
    return all;
  }

  SigningKey operator_key;
  GroupKey group;
  std::uint32_t generation = 1;
  Validity validity{kNow - 1000, kNow + 100000};
  Revoked revoked;
  std::vector<std::pair<std::uint16_t, ExchangePublic>> robots;
};

/// A guard with its memory, its clock set.
struct Member {
  Member(const AgentKeys& keys, std::size_t sessions = 16)
      : guard{{300, std::chrono::milliseconds{800}, sessions}, keys, arena} {
    guard.set_wall_clock(Team::kNow);
  }

  Arena arena{std::size_t{1} << 20};
  Guard guard;
  std::vector<std::string> heard;  ///< texts of datagrams that were let in
};

/// A datagram whose one entry is a text.
inline std::vector<std::byte> datagram(std::uint16_t agent, std::string_view text) {
  std::vector<std::byte> buffer(kMaxDatagramBytes);
  DatagramWriter out{std::span{buffer}.first(480), {{agent, 7}, 3}};
  (void)out.add(EntryKind::kBeacon, std::as_bytes(std::span{text}));
  const auto bytes = out.finish();
  return {bytes.begin(), bytes.end()};
}

inline std::vector<std::byte> copy(std::span<const std::byte> bytes) {
  return {bytes.begin(), bytes.end()};
}

/// Lets a member hear a frame. @return whether a datagram came out
inline bool hear(Member& member, std::span<const std::byte> frame, Instant now) {
  const auto inside = member.guard.open(frame, now);
  if (inside.empty()) return false;
  DatagramReader reader{inside};
  DatagramReader::Entry entry{};
  if (!reader.next(entry)) return false;
  member.heard.emplace_back(reinterpret_cast<const char*>(entry.body.data()), entry.body.size());
  return true;
}

/// Everybody hears what everybody's guard has to say, for so long.
inline void talk(const std::vector<Member*>& members, Instant& now, Duration time) {
  for (const Instant end = now + time; now < end; now += std::chrono::milliseconds{20}) {
    for (Member* from : members) {
      const auto frame = copy(from->guard.next(now));
      if (frame.empty()) continue;
      for (Member* to : members) {
        if (to != from) (void)hear(*to, frame, now);
      }
    }
  }
}

}  // namespace maplet::test
