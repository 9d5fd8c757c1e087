// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/swarm/swarm.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

namespace maplet::swarm {

namespace {

constexpr Duration kTick = std::chrono::milliseconds{25};  // mapletd's radio thread naps as long
constexpr Duration kDelay = kTick;                         // of a datagram
constexpr double kSight_m = 3.0;      // two maplets' origins: a place seen again
constexpr double kRecognised = 0.3;   // of those places
constexpr int kOwnApart = 4;          // maplets, until an own place is old
constexpr double kDriftShare = 0.01;  // of the way
constexpr double kClosure_m = 0.03;
constexpr double kClosure_rad = 0.005;

int maplets_of(const SwarmConfig& config) {
  return 1 + static_cast<int>(std::ceil(config.minutes * 60.0 / config.maplet_every_s));
}

/// Some agents, each once.
std::vector<bool> draw(const SwarmConfig& config) {
  std::vector<int> all(static_cast<std::size_t>(config.agents));
  std::iota(all.begin(), all.end(), 0);
  sim::Random random{config.seed, 2};
  std::vector<bool> drawn(all.size());
  for (int k = 0; k < std::min(config.solve, config.agents); ++k) {
    const int at = random.index(static_cast<int>(all.size()));
    drawn[static_cast<std::size_t>(all[static_cast<std::size_t>(at)])] = true;
    all.erase(all.begin() + at);
  }
  return drawn;
}

double gauss(sim::Random& random) {
  const double u = random.uniform(1e-300, 1.0);
  const double v = random.uniform(0.0, 2.0 * M_PI);
  return std::sqrt(-2.0 * std::log(u)) * std::cos(v);
}

Stamp stamp_of(double time_s) { return Stamp{std::llround(time_s * 1e9)}; }

}  // namespace

Swarm::Swarm(const SwarmConfig& config)
    : config_{config},
      paths_{config.world, config.agents, config.speed_mps, config.seed},
      contacts_{config},
      random_{config.seed, 3},
      origins_(static_cast<std::size_t>(config.agents)),
      way_m_(origins_.size()),
      next_s_(origins_.size()),
      met_(origins_.size(), std::vector<double>(origins_.size(), -1.0)),
      listeners_(origins_.size()),
      now_{std::chrono::hours{1}} {
  const int maplets = config.agents * maplets_of(config);
  const int records = 3 * maplets;  // each with two closures, at most
  const std::vector<bool> solving = draw(config);
  for (int i = 0; i < config.agents; ++i) {
    const auto agent = static_cast<std::uint16_t>(i + 1);
    const auto epoch = static_cast<std::uint32_t>(sim::mix(config.seed, agent));
    members_.push_back(std::make_unique<Member>(config, Life{agent, epoch}, records,
                                                solving[i] ? maplets : 0, now_));
    next_s_[i] = random_.uniform(0.0, config.maplet_every_s);
  }
}

void Swarm::add(int agent, DeltaPose::Kind kind, const Origin& a, const Origin& b, double sigma_m,
                double sigma_rad) {
  DeltaPose delta;
  delta.kind = kind;
  delta.a = a.key;
  delta.b = b.key;
  delta.stamp_a = a.stamp;
  delta.stamp_b = b.stamp;
  delta.covariance.diagonal() << Eigen::Vector3d::Constant(sigma_m * sigma_m),
      Eigen::Vector3d::Constant(sigma_rad * sigma_rad);
  Vector6d error;
  for (int i = 0; i < 6; ++i) error[i] = (i < 3 ? sigma_m : sigma_rad) * gauss(random_);
  delta.T_a_b.se3 = a.pose.inverse() * b.pose * Se3::exp(error);
  delta.overlap = 0.5F;
  delta.matches = 12;
  if (const auto record = members_[agent]->make(delta, now_)) made_.push_back(*record);
}

void Swarm::make_maplet(int agent) {
  auto& own = origins_[agent];
  const Life life = members_[agent]->node().self();
  const Origin origin{{life.agent, life.epoch, static_cast<std::uint32_t>(own.size())},
                      paths_.pose(agent),
                      stamp_of(time_s_)};
  if (!own.empty()) {
    const double way_m = paths_.way_m(agent) - way_m_[agent];
    add(agent, DeltaPose::Kind::kConsecutive, own.back(), origin, 0.01 + kDriftShare * way_m,
        0.002 + 0.001 * way_m);
    recognise(agent, origin);
  }
  own.push_back(origin);
  way_m_[agent] = paths_.way_m(agent);
}

// The nearest place of its own that is old, and the nearest of another that it has heard of.
void Swarm::recognise(int agent, const Origin& at) {
  const Origin* nearest[2] = {};
  double least[2] = {kSight_m, kSight_m};
  for (int other = 0; other < config_.agents; ++other) {
    const auto& origins = origins_[other];
    const std::size_t old = other == agent ? kOwnApart : 0;
    for (std::size_t k = 0; k + old < origins.size(); ++k) {
      const Origin& o = origins[k];
      const double off = (o.pose.t - at.pose.t).norm();
      const int foreign = other != agent;
      if (off >= least[foreign]) continue;
      const RecordKey tells{o.key.agent, o.key.epoch, Stream::kDeltaPoses,
                            std::max(o.key.id, 1U) - 1};
      if (foreign && !members_[agent]->holds(tells)) continue;
      least[foreign] = off;
      nearest[foreign] = &o;
    }
  }
  for (const Origin* seen : nearest)
    if (seen != nullptr && random_.chance(kRecognised))
      add(agent, DeltaPose::Kind::kClosure, *seen, at, kClosure_m, kClosure_rad);
}

void Swarm::deliver() {
  std::vector<Datagram> arriving;
  arriving.swap(flying_);
  for (const Datagram& datagram : arriving)
    for (const int to : contacts_.of(datagram.from))
      if (!random_.chance(config_.loss)) members_[to]->receive(datagram.bytes, now_);
}

void Swarm::send() {
  for (int i = 0; i < config_.agents; ++i)
    members_[i]->send(listeners_[i], now_, [&](std::span<const std::byte> bytes) {
      if (!contacts_.of(i).empty()) flying_.push_back({i, {bytes.begin(), bytes.end()}});
    });
}

void Swarm::meet() {
  paths_.advance(time_s_);
  contacts_.advance(time_s_, paths_);
  for (int a = 0; a < config_.agents; ++a) {
    for (const int b : contacts_.of(a)) met_[a][b] = time_s_ + 1.0 + config_.lease_s;
    listeners_[a] = static_cast<std::size_t>(
        std::ranges::count_if(met_[a], [&](double until) { return until > time_s_; }));
  }
}

bool Swarm::same() const {
  return std::ranges::all_of(members_, [&](const auto& member) {
    return member->node().ledger().records_digest() ==
           members_[0]->node().ledger().records_digest();
  });
}

double Swarm::held_share() const {
  double sum = 0.0;
  for (const auto& member : members_) sum += static_cast<double>(member->node().ledger().records());
  return made_.empty() ? 1.0 : sum / static_cast<double>(made_.size() * members_.size());
}

/// A full datagram's share, each agent's records in order.
double Swarm::record_bytes() const {
  auto records = made_;
  std::ranges::sort(records, {}, &DeltaPoseRecord::key);
  const LinkProfile profile = config_.profile == "radio" ? radio_profile() : wifi_profile();
  std::vector<std::byte> buffer(profile.datagram_bytes);
  std::size_t bytes = 0;
  for (std::size_t i = 0; i < records.size();) {
    const Life life{records[i].key.agent, records[i].key.epoch};
    DatagramWriter out{buffer, {life, 0}};
    RecordContext context{life.agent, life.epoch};
    for (; i < records.size(); ++i) {
      std::array<std::byte, kMaxRecordBytes> body;
      ByteWriter writer{body};
      RecordContext after = context;
      write_record(writer, after, records[i]);
      if (!out.add(EntryKind::kDeltaPose, std::span{body}.first(writer.size()))) break;
      context = after;
    }
    bytes += out.finish().size();
  }
  return records.empty() ? 0.0 : static_cast<double>(bytes) / static_cast<double>(records.size());
}

SwarmResult Swarm::run(const std::function<void(double)>& progress) {
  SwarmResult result;
  const double making_s = 60.0 * config_.minutes;
  const double most_s = making_s + 60.0 * config_.most_minutes;
  const Instant start = now_;
  for (std::uint64_t tick = 0;; ++tick) {
    now_ = start + kTick * static_cast<Duration::rep>(tick);
    time_s_ = seconds(now_ - start);
    const bool second = tick % static_cast<std::uint64_t>(std::chrono::seconds{1} / kTick) == 0;
    if (second) {
      meet();
      progress(time_s_);
      if (time_s_ == making_s) result.held_share = held_share();
      if (time_s_ >= making_s && (same() || time_s_ >= most_s)) break;
    }
    deliver();
    for (int i = 0; i < config_.agents && time_s_ < making_s; ++i) {
      if (time_s_ < next_s_[i]) continue;
      make_maplet(i);
      next_s_[i] += config_.maplet_every_s;
    }
    send();
  }
  result.agents = config_.agents;
  result.converged = same();
  result.records = made_.size();
  result.digest = members_[0]->node().ledger().records_digest();
  result.convergence_s = time_s_ - making_s;
  for (const auto& member : members_) {
    result.received += member->node().counters().received;
    result.duplicates += member->node().counters().duplicates;
    result.bytes += member->bytes();
    result.wire_bytes += member->wire_bytes();
    result.control_bytes += member->lane_bytes(Traffic::kControl);
    result.exchange_bytes = member->exchange_bytes();
    result.skeleton_bytes = std::max(result.skeleton_bytes, member->skeleton_bytes());
  }
  result.record_bytes = record_bytes();
  result.solved =
      solve(members_, [&](const MapletKey& key) { return origins_[key.agent - 1U][key.id].pose; });
  return result;
}

}  // namespace maplet::swarm
