// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "core/agent/maplet_store.hpp"
#include "core/agent/maplet_views.hpp"
#include "core/maplet/codec.hpp"
#include "core/registration/place_prior.hpp"
#include "core/skeleton/skeleton.hpp"

namespace maplet {

/// This agent's maplets where the skeleton puts them. One that the skeleton has no way to is where
/// the odometry had it, if the newest hangs on the same unbroken track or was recognised in it.
class OwnPlaces final : public PlacePrior {
 public:
  /// @param scratch  where maplets are decoded
  OwnPlaces(const Skeleton& skeleton, const MapletViews& views, MapletStore& store,
            Maplet& scratch) noexcept
      : skeleton_{skeleton}, views_{views}, store_{store}, scratch_{scratch} {}

  [[nodiscard]] int count() const noexcept override { return skeleton_.node_count(); }
  [[nodiscard]] MapletKey key(int index) const noexcept override {
    return skeleton_.node(index).key;
  }
  [[nodiscard]] bool relate(int index, const MapletKey& newest,
                            Transform<MapletA, MapletB>& T_index_newest) const noexcept override {
    const Skeleton::NodeView node = skeleton_.node(index);
    const Se3* pose = skeleton_.pose(newest);
    if (pose == nullptr) return false;
    if (node.gauge != skeleton_.gauge(newest)) return along_path(node.key, newest, T_index_newest);
    T_index_newest = Transform<MapletA, MapletB>{node.T_world_maplet.inverse() * *pose};
    return true;
  }
  [[nodiscard]] bool apart(int index, const MapletKey& newest) const noexcept override {
    return skeleton_.node(index).gauge != skeleton_.gauge(newest);
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
  [[nodiscard]] bool along_path(const MapletKey& older, const MapletKey& newest,
                                Transform<MapletA, MapletB>& T_older_newest) const noexcept {
    if (older.agent != newest.agent || older.epoch != newest.epoch) return false;
    const auto from = views_.origin_of(older);
    const auto to = views_.origin_of(newest);
    if (!from || !to || from->segment != to->segment) return false;
    T_older_newest = Transform<MapletA, MapletB>{from->T_odom_view.inverse() * to->T_odom_view};
    return true;
  }

  const Skeleton& skeleton_;
  const MapletViews& views_;
  MapletStore& store_;
  Maplet& scratch_;
};

}  // namespace maplet
