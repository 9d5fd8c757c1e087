// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/map_view.hpp"

#include <algorithm>
#include <functional>

#include "core/maplet/strips.hpp"

namespace maplet::daemon {

namespace {

constexpr double kSameM = 1e-3;  // less is not worth a message
constexpr double kSameRad = 1e-3;
constexpr std::size_t kMostRectangles = 2048;  // of a maplet, before the largest are chosen

bool same(const Se3& a, const Se3& b) noexcept {
  const Se3 off = a.inverse() * b;
  return off.t.norm() < kSameM && off.angle() < kSameRad;
}

}  // namespace

MapView::MapView(std::size_t maplets, std::size_t quads) {
  items_.reserve(maplets);
  quads_.reserve(quads);
  rectangles_.reserve(kMostRectangles);
}

MapView::Item* MapView::find(const MapletKey& key) noexcept {
  const auto at = std::ranges::lower_bound(
      items_, key, {}, [](const Item& i) -> const MapletKey& { return i.placed.key; });
  if (at != items_.end() && at->placed.key == key) return &*at;
  if (items_.size() == items_.capacity()) return nullptr;
  Item item;
  item.placed.key = key;
  return &*items_.insert(at, item);
}

void MapView::look(Agent& agent) noexcept {
  const std::unique_lock lock{mutex_, std::try_to_lock};
  if (!lock) return;
  const Skeleton& skeleton = agent.skeleton();
  // What is drawn is the map that this agent is in.
  const MapletKey map = agent.map_frame().map;
  HeldMaplets held = agent.held_maplets();
  bool may_decode = true;
  for (int i = 0; i < kAtOnce; ++i) {
    if (next_ >= skeleton.node_count()) {
      for (Item& item : items_) {
        if (item.round == round_ || item.gone) continue;
        item.gone = item.changed = true;
        item.drawn = true;
      }
      next_ = 0;
      ++round_;
      return;
    }
    const Skeleton::NodeView node = skeleton.node(next_++);
    if (node.gauge != map) continue;
    Item* item = find(node.key);
    if (item == nullptr) continue;
    item->round = round_;
    item->gone = false;
    if (!same(item->placed.T_world_maplet, node.T_world_maplet)) {
      item->placed.T_world_maplet = node.T_world_maplet;
      item->changed = true;
    }
    if (item->drawn || !may_decode) continue;
    if (const Maplet* maplet = held.find(node.key)) {
      draw(*maplet, *item);
      may_decode = false;
    }
  }
}

void MapView::draw(const Maplet& maplet, Item& item) noexcept {
  rectangles_.clear();
  for (std::size_t i = 0; i < maplet.planes.size(); ++i) cut(maplet, i);
  const std::size_t room = std::min(kMostOfMaplet, quads_.capacity() - quads_.size());
  if (rectangles_.size() > room) {
    std::ranges::sort(rectangles_, std::greater{}, &Rectangle::area_m2);
    left_out_ += rectangles_.size() - room;
    rectangles_.resize(room);
  }
  item.first = static_cast<std::uint32_t>(quads_.size());
  item.count = static_cast<std::uint32_t>(rectangles_.size());
  for (const Rectangle& r : rectangles_) {
    const MapletPlane& plane = maplet.planes[r.plane];
    const PlaneBasis basis = plane.basis();
    const double size_m = maplet.cell_m_of(plane.grid);
    const auto point = [&](int column, int row) -> Eigen::Vector3f {
      return basis.point((plane.grid.column0 + column) * size_m, (plane.grid.row0 + row) * size_m)
          .cast<float>();
    };
    quads_.push_back(
        {{point(r.column, r.row), point(r.column + r.columns, r.row),
          point(r.column + r.columns, r.row + r.rows), point(r.column, r.row + r.rows)}});
  }
  item.drawn = item.changed = true;
}

// Rows of cells below each other with the same ends are one rectangle.
void MapView::cut(const Maplet& maplet, std::size_t plane) noexcept {
  const std::size_t first = rectangles_.size();
  for_each_strip(maplet, maplet.planes[plane], [&](int column, int row, int columns) {
    const auto above =
        std::find_if(rectangles_.begin() + static_cast<std::ptrdiff_t>(first), rectangles_.end(),
                     [&](const Rectangle& r) {
                       return r.column == column && r.columns == columns && r.row + r.rows == row;
                     });
    if (above != rectangles_.end()) {
      ++above->rows;
    } else if (rectangles_.size() < kMostRectangles) {
      rectangles_.push_back({plane, column, row, columns, 1, 0.0});
    } else {
      ++left_out_;
    }
  });
  const double size_m = maplet.cell_m_of(maplet.planes[plane].grid);
  for (std::size_t i = first; i < rectangles_.size(); ++i) {
    Rectangle& r = rectangles_[i];
    r.area_m2 = r.columns * r.rows * size_m * size_m;
  }
}

// Their pieces are taken out, the others' move up.
void MapView::forget_gone() noexcept {
  for (std::size_t i = items_.size(); i-- > 0;) {
    const Item gone = items_[i];
    if (!gone.gone || gone.changed) continue;
    quads_.erase(quads_.begin() + gone.first, quads_.begin() + gone.first + gone.count);
    items_.erase(items_.begin() + static_cast<std::ptrdiff_t>(i));
    for (Item& item : items_)
      if (item.first > gone.first) item.first -= gone.count;
  }
}

}  // namespace maplet::daemon
