// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/agent/maplet_store.hpp"
#include "core/maplet/codec.hpp"
#include "core/skeleton/overlay.hpp"

namespace maplet {

/// The maplets that this agent holds, its own and others': what an overlay shows.
class HeldMaplets final : public MapletLookup {
 public:
  /// @param scratch  where maplets are decoded; what find() returned last lives there
  HeldMaplets(const MapletStore& own, const MapletStore& foreign, Maplet& scratch) noexcept
      : own_{own}, foreign_{foreign}, scratch_{scratch} {}

  [[nodiscard]] const Maplet* find(const MapletKey& key) noexcept override {
    auto bytes = own_.find(key);
    if (!bytes) bytes = foreign_.find(key);
    return bytes && decode(*bytes, scratch_) ? &scratch_ : nullptr;
  }

 private:
  const MapletStore& own_;
  const MapletStore& foreign_;
  Maplet& scratch_;
};

}  // namespace maplet
