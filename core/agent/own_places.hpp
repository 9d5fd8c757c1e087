// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/agent/maplet_store.hpp"
#include "core/maplet/codec.hpp"
#include "core/registration/place_prior.hpp"
#include "core/skeleton/skeleton.hpp"

namespace maplet {

/// This agent's maplets where the skeleton puts them.
class OwnPlaces final : public PlacePrior {
 public:
  /// @param scratch  where maplets are decoded
  OwnPlaces(const Skeleton& skeleton, MapletStore& store, Maplet& scratch) noexcept
      : skeleton_{skeleton}, store_{store}, scratch_{scratch} {}

  [[nodiscard]] int count() const noexcept override { return skeleton_.node_count(); }
  [[nodiscard]] MapletKey key(int index) const noexcept override {
    return skeleton_.node(index).key;
  }
  [[nodiscard]] bool relate(int index, const MapletKey& newest,
                            Transform<MapletA, MapletB>& T_index_newest) const noexcept override {
    const Skeleton::NodeView node = skeleton_.node(index);
    const Se3* pose = skeleton_.pose(newest);
    if (pose == nullptr || node.gauge != skeleton_.gauge(newest)) return false;
    T_index_newest = Transform<MapletA, MapletB>{node.T_world_maplet.inverse() * *pose};
    return true;
  }
  [[nodiscard]] const Maplet* load(int index) noexcept override {
    const auto bytes = store_.find(key(index));
    if (!bytes || !decode(*bytes, scratch_)) return nullptr;
    if (!store_.knows_frontier(key(index)))  // of an earlier run
      store_.set_frontier(key(index), find_frontier(scratch_, up_of(scratch_)).region);
    return &scratch_;
  }
  [[nodiscard]] const RegionOfInterest* frontier(int index) const noexcept override {
    return store_.frontier(key(index));
  }

 private:
  const Skeleton& skeleton_;
  MapletStore& store_;
  Maplet& scratch_;
};

}  // namespace maplet
