// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "core/agent/agent.hpp"
#include "daemon/output_frames.hpp"
#include "transport/ros2/topics.hpp"

namespace maplet::daemon {

/// The map as others draw it: the surfaces of all maplets held here, each where the skeleton puts
/// it. The estimator looks at a few maplets between frames; a publisher takes what has changed.
///
/// Memory   fixed: so many maplets, so many pieces. What does not fit is counted.
/// Threads  look() by the estimator's, which never waits: when somebody takes just then, the next
///   frame will do; the rest by one other.
/// Time     look(): kAtOnce poses, and one maplet decoded (about 0.1 ms) where one is new.
class MapView {
 public:
  static constexpr int kAtOnce = 64;
  static constexpr std::size_t kMostOfMaplet = 160;  ///< pieces; of more the largest

  MapView(std::size_t maplets, std::size_t quads);

  void look(Agent& agent) noexcept;

  struct Placed {
    MapletKey key;
    Se3 T_world_maplet;
  };
  struct Item {
    Placed placed;
    std::uint32_t first = 0;  ///< of its pieces
    std::uint32_t count = 0;
    std::uint32_t round = 0;  ///< last seen in
    bool drawn = false;       ///< its pieces are here, or it has none
    bool changed = true;      ///< since it was taken
    bool gone = false;        ///< nowhere in the skeleton any more
  };
  /// Calls take(item, pieces) for items that have changed, until it says false or there are no
  /// more; what was taken counts as unchanged. Gone ones are forgotten then.
  /// @return whether all were taken
  template <class Take>
  bool take_changed(Take&& take) {
    const std::scoped_lock lock{mutex_};
    for (Item& item : items_) {
      if (!item.changed || !item.drawn) continue;
      if (!take(std::as_const(item), std::span{quads_}.subspan(item.first, item.count)))
        return false;
      item.changed = false;
    }
    forget_gone();
    return true;
  }
  /// Everything is to be taken anew: somebody has come, or the map moved as a whole.
  void change_all() {
    const std::scoped_lock lock{mutex_};
    for (Item& item : items_) item.changed = true;
  }
  /// Calls use(pose_of), where pose_of(key) is T_world_maplet, or nullptr.
  template <class Use>
  void poses(Use&& use) const {
    const std::scoped_lock lock{mutex_};
    use([this](const MapletKey& key) -> const Se3* {
      const auto at = std::ranges::lower_bound(
          items_, key, {}, [](const Item& i) -> const MapletKey& { return i.placed.key; });
      return at != items_.end() && at->placed.key == key ? &at->placed.T_world_maplet : nullptr;
    });
  }
  struct Counts {
    std::size_t maplets = 0, quads = 0;
    std::uint64_t left_out = 0;  ///< pieces that had no room
  };
  [[nodiscard]] Counts counts() const {
    const std::scoped_lock lock{mutex_};
    return {items_.size(), quads_.size(), left_out_};
  }
  [[nodiscard]] static std::size_t bytes(std::size_t maplets, std::size_t quads) noexcept {
    return maplets * sizeof(Item) + quads * sizeof(RosQuad) + sizeof(MapView);
  }

 private:
  struct Rectangle {  // of a plane's cells
    std::size_t plane;
    int column, row, columns, rows;
    double area_m2;
  };
  [[nodiscard]] Item* find(const MapletKey& key) noexcept;
  void draw(const Maplet& maplet, Item& item) noexcept;
  void cut(const Maplet& maplet, std::size_t plane) noexcept;
  void forget_gone() noexcept;

  mutable std::mutex mutex_;
  std::vector<Item> items_;  ///< sorted by key; capacity reserved
  std::vector<RosQuad> quads_;
  std::vector<Rectangle> rectangles_;  ///< of one maplet
  int next_ = 0;                       ///< node to look at
  std::uint32_t round_ = 1;
  std::uint64_t left_out_ = 0;
};

}  // namespace maplet::daemon
