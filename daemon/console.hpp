// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/agent/agent.hpp"
#include "daemon/control_server.hpp"
#include "daemon/flight_log.hpp"
#include "daemon/gpio_panel.hpp"
#include "daemon/journal_writer.hpp"
#include "daemon/live_config.hpp"
#include "daemon/memory_status.hpp"
#include "daemon/radio_link.hpp"
#include "daemon/status_board.hpp"
#include "drivers/gray_camera.hpp"

namespace maplet::daemon {

class Neighbours;

/// What the operator asks over the control socket, and the answers.
///
/// Questions about the skeleton are answered by the estimator's thread between two frames: it
/// copies numbers into fixed memory, the server's thread makes text of them.
///
/// Memory   fixed on the estimator's side.
/// Threads  attend() from the estimator's thread, without waiting or allocation; the rest from the
///   server's.
class Console {
 public:
  /// What it tells of, and what it changes.
  struct Subjects {
    AgentIdentity identity;
    const StatusBoard& board;
    const MemoryStatus& memory;
    LiveConfig& config;
    RadioLink* radio;                  ///< nullptr: --no-dds
    const GpioPanel* gpio = nullptr;   ///< nullptr: no line is used
    const GrayCamera* gray = nullptr;  ///< nullptr: none beside the depth camera
    JournalWriter* journal = nullptr;  ///< nullptr: the mission is in memory only
    const StateDirectory* state = nullptr;
    FlightLog* flight = nullptr;
    const Neighbours* neighbours = nullptr;  ///< nullptr: nobody else on this robot is told
  };
  /// @param max_nodes  of the skeleton
  Console(const Subjects& subjects, std::size_t max_nodes)
      : about_us_{subjects},
        maplets_(std::min(kMaxMaplets, max_nodes)),
        way_maplets_(maplets_.size()) {}
  [[nodiscard]] static std::size_t bytes(std::size_t max_nodes) {
    return sizeof(Console) +
           std::min(kMaxMaplets, max_nodes) * (sizeof(MapletLine) + sizeof(MapletKey));
  }

  /// @return one line that says why nobody can ask, or nothing
  [[nodiscard]] std::string open(const std::string& path);
  [[nodiscard]] bool is_open() const noexcept { return server_ != nullptr; }
  void close() noexcept { server_.reset(); }

  /// Answers what waits. Call it often.
  void attend(Agent& agent, Deadline deadline) noexcept {
    if (asked_.load(std::memory_order_acquire)) answer(agent, deadline);
  }

 private:
  static constexpr std::size_t kMaxClosures = 1024;
  static constexpr std::size_t kMaxMaplets = 4096;
  enum class Question : std::uint8_t { kClosures, kWhy, kAdd, kMaplets, kDecide, kWay, kOverlay };
  struct MapletLine {
    Skeleton::NodeView node;
    std::uint32_t bytes = 0;  ///< of one of ours; 0 = gone, or another's
  };
  struct ClosureLine {
    MapletKey a;
    MapletKey b;
    double chi2 = 0.0;
    double weight = 0.0;
    double length_m = 0.0;
    bool torn = false;
  };
  struct NewClosure {
    std::uint16_t agent_a = 0;
    std::uint32_t id_a = 0;
    std::uint16_t agent_b = 0;
    std::uint32_t id_b = 0;
    Se3 T_a_b;
  };

  /// A maplet by its agent and number, or an agent's newest.
  struct PlaceName {
    std::uint16_t agent = 0;
    std::optional<std::uint32_t> id;
  };
  struct PlaneLine {
    MapletKey maplet;
    Plane plane;  ///< in the map
    Eigen::Vector3d centre;
    double area_m2 = 0.0;
  };

  // console.cpp: the estimator's side
  void answer(Agent& agent, Deadline deadline) noexcept;
  void list_closures(const Agent& agent) noexcept;
  void list_maplets(const Agent& agent) noexcept;
  void add_closure(Agent& agent, Deadline deadline) noexcept;
  void decide_closure(Agent& agent, Deadline deadline) noexcept;
  /// The maplets that an operator names, in their latest lives. @return whether both are there
  [[nodiscard]] bool find_named(const Skeleton& skeleton, MapletKey& a,
                                MapletKey& b) const noexcept;
  void look_into(const Agent& agent) noexcept;
  // console_ways.cpp: both sides
  [[nodiscard]] bool find_place(const Skeleton& skeleton, const PlaceName& name,
                                MapletKey& key) const noexcept;
  void find_way(Agent& agent) noexcept;
  void lay_part_over(Agent& agent) noexcept;
  [[nodiscard]] std::string way_text(const std::string& line);
  [[nodiscard]] std::string overlay_text(const std::string& line);
  /// Asks the estimator. @return false when it did not answer in time
  bool ask(Question question, int agent);

  // console_text.cpp: the server's side
  [[nodiscard]] std::string reply(const std::string& line);
  [[nodiscard]] std::string answer_to(const std::string& line);
  [[nodiscard]] static NewClosure named(const nlohmann::ordered_json& question);
  [[nodiscard]] std::string status_text() const;  // status_text.cpp
  [[nodiscard]] std::string mission_text() const;
  [[nodiscard]] nlohmann::ordered_json mission_json() const;
  [[nodiscard]] std::string recorder_text(const std::string& file) const;
  [[nodiscard]] std::string security_text() const;
  [[nodiscard]] std::string keys_text(const std::string& notice) const;
  [[nodiscard]] std::string peers_text() const;
  [[nodiscard]] std::string why_text(int agent);
  [[nodiscard]] std::string closures_text();
  [[nodiscard]] std::string maplets_text();
  [[nodiscard]] std::string add_text(const std::string& line);
  [[nodiscard]] std::string decide_text(const std::string& line);
  [[nodiscard]] std::string set_text(const std::string& key, const std::string& value);
  [[nodiscard]] std::string radio_text(const std::string& what);

  Subjects about_us_;
  std::mutex question_mutex_;
  std::condition_variable answered_cv_;
  std::atomic<bool> asked_{false};
  bool answered_ = false;
  Question question_ = Question::kClosures;
  int about_ = 0;
  std::size_t closure_count_ = 0;
  std::array<ClosureLine, kMaxClosures> closures_;
  std::size_t maplet_count_ = 0;
  std::vector<MapletLine> maplets_;
  struct Why {
    std::uint32_t nodes = 0;          ///< of that agent in the skeleton
    std::uint32_t related = 0;        ///< of these in one group with ours
    std::uint32_t closures = 0;       ///< between the two
    std::uint32_t closures_kept = 0;  ///< of these with weight
    std::uint32_t closures_torn = 0;  ///< of these: some say one thing, as many another
    EncounterCounts looked;           ///< how its maplets compare with ours
  } why_;

  NewClosure new_closure_;
  bool accept_ = false;
  int decided_ = 0;  ///< closures between the two
  enum class AddedClosure : std::uint8_t { kAdded, kRefused, kUnknownMaplet } added_{};

  static constexpr std::size_t kMaxPlanes = 2048;
  static constexpr int kMapletsAtOnce = 32;  ///< of an overlay, between two frames
  PlaceName from_;
  PlaceName to_;
  bool places_known_ = false;
  Skeleton::Way way_;
  std::vector<MapletKey> way_maplets_;
  double fidelity_ = 1.0;
  int first_node_ = 0;
  int next_node_ = -1;  ///< -1: that was all
  Overlay overlay_;
  std::size_t plane_count_ = 0;
  std::array<PlaneLine, kMaxPlanes> planes_;

  std::unique_ptr<ControlServer> server_;
};

}  // namespace maplet::daemon
