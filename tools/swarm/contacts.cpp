// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/swarm/contacts.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace maplet::swarm {

Contacts::Contacts(const SwarmConfig& config)
    : config_{config},
      random_{config.seed, 1},
      heard_by_(static_cast<std::size_t>(config.agents)),
      busy_(static_cast<std::size_t>(config.agents)) {
  if (config.contacts == "near") plan_ = Plan::kNear;
  if (config.contacts == "all") plan_ = Plan::kAll;
  if (plan_ == Plan::kRandom && config.contacts != "random") {
    plan_ = Plan::kFile;
    read(config.contacts);
  }
}

void Contacts::read(const std::string& path) {
  std::ifstream in{path};
  if (!in)
    throw std::invalid_argument{fmt::format(
        "contacts '{}': there are random, near, all, or a file that can be read", path)};
  int number = 0;
  for (std::string line; std::getline(in, line);) {
    ++number;
    line.resize(std::min(line.find('#'), line.size()));
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    std::istringstream words{line};
    Meeting m{};
    std::string more;
    const auto bad = [&](const std::string& why) {
      return std::invalid_argument{fmt::format("{}:{}: {}", path, number, why)};
    };
    if (!(words >> m.from_s >> m.to_s >> m.a >> m.b) || words >> more)
      throw bad("a meeting is: from_s to_s agent agent");
    if (!std::isfinite(m.from_s) || !(m.to_s > m.from_s)) throw bad("it ends before it begins");
    for (const int agent : {m.a, m.b})
      if (agent < 1 || agent > config_.agents)
        throw bad(fmt::format("agent {} of 1 .. {}", agent, config_.agents));
    if (m.a == m.b) throw bad("an agent that meets itself");
    --m.a, --m.b;
    meetings_.push_back(m);
  }
  if (in.bad())
    throw std::invalid_argument{fmt::format("contacts '{}': cannot be read; is it a file?", path)};
  if (meetings_.empty())
    throw std::invalid_argument{fmt::format("contacts '{}': there is no meeting in it", path)};
}

// A free agent looks for another one often enough that meetings, both kinds of them, come at
// meet_every_s.
void Contacts::meet_at_random(double time_s) {
  std::erase_if(meetings_, [&](const Meeting& m) { return m.to_s <= time_s; });
  std::fill(busy_.begin(), busy_.end(), false);
  for (const Meeting& m : meetings_) busy_[m.a] = busy_[m.b] = true;
  const double alone_s = std::max(1.0, config_.meet_every_s - config_.meet_for_s);
  for (int a = 0; a < config_.agents; ++a) {
    if (busy_[a] || !random_.chance(0.5 / alone_s)) continue;
    const int b = random_.index(config_.agents);
    if (b == a || busy_[b]) continue;
    busy_[a] = busy_[b] = true;
    meetings_.push_back({time_s, time_s + config_.meet_for_s, a, b});
  }
}

void Contacts::advance(double time_s, const Paths& paths) {
  if (plan_ == Plan::kRandom) meet_at_random(time_s);
  for (auto& others : heard_by_) others.clear();
  const auto hear = [&](int a, int b) {
    if (std::ranges::find(heard_by_[a], b) != heard_by_[a].end()) return;
    heard_by_[a].push_back(b);
    heard_by_[b].push_back(a);
  };
  if (plan_ == Plan::kRandom || plan_ == Plan::kFile) {
    for (const Meeting& m : meetings_)
      if (m.from_s <= time_s && time_s < m.to_s) hear(m.a, m.b);
    return;
  }
  for (int a = 0; a < config_.agents; ++a)
    for (int b = 0; b < a; ++b)
      if (plan_ == Plan::kAll || (paths.place(a) - paths.place(b)).norm() <= config_.range_m)
        hear(a, b);
}

}  // namespace maplet::swarm
