// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/agent/maplet_store.hpp"

#include <algorithm>
#include <cstdlib>

namespace maplet {

MapletStore::MapletStore(std::size_t slots, std::size_t slot_bytes, Arena& arena)
    : slot_bytes_{slot_bytes},
      slots_{arena.make_array<Slot>(slots, "agent/maplet slots")},
      bytes_{arena.make_array<std::byte>(slots * slot_bytes, "agent/own maplets")} {}

void MapletStore::put(std::uint32_t id, std::span<const std::byte> bytes) noexcept {
  if (bytes.empty() || bytes.size() > slot_bytes_) std::abort();
  const std::size_t slot = id % slots_.size();
  if (slots_[slot].bytes != 0) ++forgotten_;
  slots_[slot] = {id, static_cast<std::uint32_t>(bytes.size())};
  std::ranges::copy(bytes, storage(slot).begin());
}

std::optional<std::span<const std::byte>> MapletStore::find(std::uint32_t id) const noexcept {
  const std::size_t slot = id % slots_.size();
  if (slots_[slot].bytes == 0 || slots_[slot].id != id) return {};
  return storage(slot).first(slots_[slot].bytes);
}

}  // namespace maplet
