// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <unordered_map>
#include <vector>

#include "core/skeleton/condenser.hpp"
#include "core/skeleton/forwarding.hpp"

namespace maplet::graphs {

/// Which node a file's vertex is, also when the graph is kept small and the vertex was taken out.
template <class Space>
class NodeTable {
 public:
  NodeTable(PoseGraph<Space>& solver, std::size_t ids) : solver_{solver} {
    node_of_.reserve(2 * ids);
    last_.reserve(256);
    id_of_.resize(static_cast<std::size_t>(solver.graph().max_nodes()));
  }

  /// Keeps the graph within its limits from now on.
  void limit(Arena& arena) {
    marginals_.emplace(solver_.graph(), solver_.elimination(), arena);
    condenser_.emplace(solver_, *marginals_, arena);
    forwarding_.emplace(kForwards * solver_.graph().max_nodes(), arena);
  }
  [[nodiscard]] bool limited() const { return condenser_.has_value(); }
  [[nodiscard]] const Condenser<Space>& condenser() const { return *condenser_; }

  /// A vertex that will come: no memory is taken when it does.
  /// @return whether it is the first that is heard of it
  bool expect(std::uint64_t id) { return node_of_.try_emplace(id, kComing).second; }
  [[nodiscard]] bool has(std::uint64_t id) const {
    const auto found = node_of_.find(id);
    return found != node_of_.end() && found->second != kComing;
  }
  void put(std::uint64_t id, int node) {
    node_of_[id] = node;
    id_of_[static_cast<std::size_t>(node)] = id;
    if (!limited() || solver_.graph().node(node).point) return;
    // The newest of each agent stays.
    const auto last = std::find_if(last_.begin(), last_.end(),
                                   [&](std::uint64_t other) { return other >> 56 == id >> 56; });
    if (last == last_.end()) {
      last_.push_back(id);
    } else {
      if (const int old = node_of_[*last]; old >= 0) solver_.graph().node(old).keep = false;
      *last = id;
    }
    solver_.graph().node(node).keep = true;
  }

  struct Place {
    int node = -1;
    Relation<Space> from_node;  ///< T_node_vertex
    bool moved = false;
  };
  /// @return nothing for one that was taken out and is forgotten
  [[nodiscard]] std::optional<Place> find(std::uint64_t id) const {
    if (const int node = node_of_.at(id); node >= 0) return Place{node, {}, false};
    if (!forwarding_) return std::nullopt;
    Place place;
    std::uint64_t hub = 0;
    const auto stands = [&](std::uint64_t at) { return node_of_.at(at) >= 0; };
    if (!forwarding_->resolve(id, stands, hub, place.from_node)) return std::nullopt;
    place.node = node_of_.at(hub);
    place.moved = true;
    return place;
  }

  /// Makes room for what comes. `gone` is called for each node, `freed` for each factor that went.
  template <class Gone, class Freed>
  void make_room(int nodes, int factors, Gone&& gone, Freed&& freed) {
    if (!limited() || condenser_->has_room(nodes, factors)) return;
    (void)condenser_->make_room(nodes, factors);
    for (const auto& c : condenser_->contractions()) {
      const std::uint64_t id = id_of_[static_cast<std::size_t>(c.node)];
      node_of_[id] = kGone;
      gone(c.node);
      if (c.hub >= 0)
        forwarding_->put(id, id_of_[static_cast<std::size_t>(c.hub)], {c.T_hub_node, c.covariance});
    }
    condenser_->finish();
    solver_.take_freed(freed);
  }

  /// Calls visit(id, node) for each vertex that stands, by id.
  template <class Visit>
  void for_each(Visit&& visit) const {
    std::vector<std::pair<std::uint64_t, int>> sorted;
    for (const auto& [id, node] : node_of_)
      if (node >= 0) sorted.emplace_back(id, node);
    std::sort(sorted.begin(), sorted.end());
    for (const auto& [id, node] : sorted) visit(id, node);
  }
  [[nodiscard]] std::uint64_t id_of(int node) const {
    return id_of_[static_cast<std::size_t>(node)];
  }

 private:
  static constexpr int kComing = -1;
  static constexpr int kGone = -2;
  static constexpr int kForwards = 8;  ///< a node of the limit

  PoseGraph<Space>& solver_;
  std::unordered_map<std::uint64_t, int> node_of_;
  std::vector<std::uint64_t> id_of_;
  std::vector<std::uint64_t> last_;  ///< of each agent
  std::optional<Marginals<Space>> marginals_;
  std::optional<Condenser<Space>> condenser_;
  std::optional<Forwarding<Space, std::uint64_t>> forwarding_;
};

}  // namespace maplet::graphs
