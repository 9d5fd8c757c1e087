// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/agent/maplet_store.hpp"

#include <algorithm>

namespace maplet {

MapletStore::MapletStore(std::size_t slots, std::size_t max_bytes, Arena& arena,
                         std::string_view slots_name, std::string_view bytes_name)
    : max_bytes_{max_bytes},
      slots_{arena.make_array<Slot>(slots, slots_name)},
      bytes_{arena.make_array<std::byte>(
          std::max(slots * std::min(max_bytes, kExpectedBytes), max_bytes), bytes_name)} {}

bool MapletStore::put(const MapletKey& key, std::span<const std::byte> bytes) noexcept {
  if (bytes.empty() || bytes.size() > max_bytes_ || slot_of(key)) return false;
  make_room(bytes.size());
  slots_[count_++ % slots_.size()] = {
      key, static_cast<std::uint32_t>(next_), static_cast<std::uint32_t>(bytes.size()), {}};
  std::ranges::copy(bytes, bytes_.subspan(next_).begin());
  next_ += bytes.size();
  return true;
}

bool MapletStore::oldest_begins_in(std::size_t from, std::size_t to) const noexcept {
  if (forgotten_ == count_) return false;
  const std::size_t at = slots_[forgotten_ % slots_.size()].at;
  return at >= from && at < to;
}

void MapletStore::make_room(std::size_t size) noexcept {
  if (count_ - forgotten_ == slots_.size()) forget_oldest();
  if (next_ + size > bytes_.size()) {  // what lies behind is of the last lap, the oldest
    while (oldest_begins_in(next_, bytes_.size())) forget_oldest();
    next_ = 0;
  }
  while (oldest_begins_in(next_, next_ + size)) forget_oldest();
}

std::optional<std::size_t> MapletStore::slot_of(const MapletKey& key) const noexcept {
  const auto holds = [&](const Slot& slot) { return slot.bytes != 0 && slot.key == key; };
  const std::size_t likely = key.id % slots_.size();
  if (holds(slots_[likely])) return likely;
  const auto found = std::ranges::find_if(slots_, holds);
  if (found == slots_.end()) return {};
  return static_cast<std::size_t>(found - slots_.begin());
}

std::optional<std::span<const std::byte>> MapletStore::find(const MapletKey& key) const noexcept {
  const auto slot = slot_of(key);
  if (!slot) return {};
  return bytes_.subspan(slots_[*slot].at, slots_[*slot].bytes);
}

void MapletStore::set_frontier(const MapletKey& key, const RegionOfInterest& frontier) noexcept {
  if (const auto slot = slot_of(key)) slots_[*slot].frontier = frontier;
}

const RegionOfInterest* MapletStore::frontier(const MapletKey& key) const noexcept {
  const auto slot = slot_of(key);
  return slot && !slots_[*slot].frontier.corners.empty() ? &slots_[*slot].frontier : nullptr;
}

}  // namespace maplet
