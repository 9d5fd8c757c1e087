// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/agent/maplet_store.hpp"

#include <algorithm>

namespace maplet {

MapletStore::MapletStore(std::size_t slots, std::size_t slot_bytes, Arena& arena,
                         std::string_view slots_name, std::string_view bytes_name)
    : slot_bytes_{slot_bytes},
      slots_{arena.make_array<Slot>(slots, slots_name)},
      bytes_{arena.make_array<std::byte>(slots * slot_bytes, bytes_name)} {}

bool MapletStore::put(const MapletKey& key, std::span<const std::byte> bytes) noexcept {
  if (bytes.empty() || bytes.size() > slot_bytes_ || slot_of(key)) return false;
  const std::size_t at = count_++ % slots_.size();
  slots_[at] = {key, static_cast<std::uint32_t>(bytes.size()), {}};
  std::ranges::copy(bytes, storage(at).begin());
  return true;
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
  return storage(*slot).first(slots_[*slot].bytes);
}

void MapletStore::set_frontier(const MapletKey& key, const RegionOfInterest& frontier) noexcept {
  if (const auto slot = slot_of(key)) slots_[*slot].frontier = frontier;
}

const RegionOfInterest* MapletStore::frontier(const MapletKey& key) const noexcept {
  const auto slot = slot_of(key);
  return slot && !slots_[*slot].frontier.corners.empty() ? &slots_[*slot].frontier : nullptr;
}

}  // namespace maplet
