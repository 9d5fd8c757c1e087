// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "tools/swarm/contacts.hpp"
#include "tools/swarm/member.hpp"
#include "tools/swarm/paths.hpp"
#include "tools/swarm/swarm_config.hpp"

namespace maplet::swarm {

/// What one agent made of all records.
struct Solved {
  int agent = 0;
  double apart_m = 0.0;       ///< from the first of them, the maplet that differs most
  bool same_verdicts = true;  ///< on closures, as the first of them
  int maplets = 0;
  int closures_rejected = 0;
  std::uint64_t overflows = 0;  ///< factors set aside for want of room: none, or it is no result
  int groups = 0;               ///< that nothing relates to each other
  double settle_s = 0.0;
  double error_m = 0.0;  ///< rms of the largest group against the paths, gauge aligned
};

struct SwarmResult {
  int agents = 0;
  bool converged = false;      ///< all hold the same records at the end
  std::uint64_t records = 0;   ///< made
  std::uint64_t digest = 0;    ///< of the first agent's records
  double held_share = 0.0;     ///< of the records, by the mean agent, when the last was made
  double convergence_s = 0.0;  ///< after the last record; to the end if it did not come
  std::uint64_t received = 0;  ///< new records, by all agents
  std::uint64_t duplicates = 0;
  std::uint64_t bytes = 0;          ///< of all datagrams, by all agents
  std::uint64_t wire_bytes = 0;     ///< with IP, UDP and DDS
  std::uint64_t control_bytes = 0;  ///< of `bytes`: digests, beacons, requests
  double record_bytes = 0.0;        ///< a full datagram's, for each record in it
  std::size_t exchange_bytes = 0;   ///< memory of one agent, by its ledger
  std::size_t skeleton_bytes = 0;   ///< memory of one that solves
  std::vector<Solved> solved;

  /// All believe the same closures, and their poses differ by less than settling iterates to.
  [[nodiscard]] bool skeletons_equal() const {
    return std::ranges::all_of(
        solved, [](const Solved& s) { return s.same_verdicts && s.apart_m < kSame_m; });
  }
  static constexpr double kSame_m = 1e-6;

  [[nodiscard]] double bytes_per_record() const {
    const double all = static_cast<double>(records) * agents;
    return records == 0 ? 0.0 : static_cast<double>(bytes) / all;
  }
};

/// Many agents that walk, make a maplet now and then, recognise what they or others have seen, and
/// tell each other when they meet: the exchange and the skeleton as mapletd has them, cameras and
/// radios simulated. The same for the same configuration, but for the times.
///
/// Threads  run() uses all processors for the skeletons at the end; else one.
class Swarm {
 public:
  /// @throw std::invalid_argument: a configuration that makes no sense
  explicit Swarm(const SwarmConfig& config);

  /// @param progress  called with the simulated seconds, each second
  SwarmResult run(const std::function<void(double)>& progress);

 private:
  struct Origin {  // of a maplet
    MapletKey key;
    Se3 pose;
    Stamp stamp;
  };
  struct Datagram {
    int from;
    std::vector<std::byte> bytes;
  };

  void make_maplet(int agent);
  void recognise(int agent, const Origin& now_at);
  void add(int agent, DeltaPose::Kind kind, const Origin& a, const Origin& b, double sigma_m,
           double sigma_rad);
  void deliver();
  void send();
  void meet();
  [[nodiscard]] bool same() const;
  [[nodiscard]] double held_share() const;
  [[nodiscard]] double record_bytes() const;

  SwarmConfig config_;
  Paths paths_;
  Contacts contacts_;
  sim::Random random_;
  std::vector<std::unique_ptr<Member>> members_;
  std::vector<std::vector<Origin>> origins_;  ///< by agent
  std::vector<double> way_m_;                 ///< at the newest origin
  std::vector<double> next_s_;                ///< when the next one is due
  std::vector<std::vector<double>> met_;      ///< until when DDS takes b for present, by a
  std::vector<std::size_t> listeners_;
  std::vector<Datagram> flying_;
  std::vector<DeltaPoseRecord> made_;
  double time_s_ = 0.0;
  Instant now_;
};

/// Settles the skeletons of those members that have one, on all processors.
/// @param truth  by agent and maplet
[[nodiscard]] std::vector<Solved> solve(std::vector<std::unique_ptr<Member>>& members,
                                        const std::function<Se3(const MapletKey&)>& truth);

}  // namespace maplet::swarm
