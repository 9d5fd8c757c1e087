// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <random>
#include <vector>

#include "core/maplet/builder.hpp"
#include "tests/support/synthetic_keyframes.hpp"

namespace maplet::test {

// Walks a path and keeps every maplet that comes out.
class Walk {
 public:
  explicit Walk(const MapletConfig& config = {},
                const std::vector<test::Wall>& walls = test::room())
      : builder_{config, ImageSize{320, 240}, arena_},
        walls_{walls},
        keyframe_{std::make_unique<Keyframe>()} {
    builder_.identify(2, 77, 5);
  }

  void step(const Se3& T_world_camera, std::mt19937* noise = nullptr) {
    if (walls_.empty()) {
      keyframe_->patches.patches.clear();
      keyframe_->patches.planes.clear();
    } else {
      test::render(walls_, T_world_camera, *keyframe_, noise);
    }
    ++steps_;
    keyframe_->id = static_cast<std::uint32_t>(steps_);
    keyframe_->stamp = Stamp{1'000'000'000} + steps_ * Stamp{100'000'000};
    keyframe_->T_odom_camera.se3 = T_world_camera;
    keyframe_->covariance = Matrix6d::Identity() * 1e-6;
    keep(builder_.add(*keyframe_, nullptr, Deadline::never()));
  }
  void finish() { keep(builder_.finish()); }
  void lose() { ++keyframe_->segment; }
  void show(const std::vector<test::Wall>& walls) { walls_ = walls; }
  [[nodiscard]] MapletBuilder& builder() { return builder_; }
  [[nodiscard]] Keyframe& keyframe() { return *keyframe_; }

  struct Kept {
    std::unique_ptr<Maplet> maplet;
    PathLink link;
    CutReason reason;
    std::size_t bytes;
    PointShare points;
  };
  std::vector<Kept> maplets;
  [[nodiscard]] const MapletCounts& counts() const { return builder_.counts(); }

 private:
  void keep(const MapletCut* cut) {
    if (cut == nullptr) return;
    maplets.push_back({std::make_unique<Maplet>(cut->maplet), cut->link, cut->reason,
                       cut->bytes.size(), cut->points});
  }

  Arena arena_;
  MapletBuilder builder_;
  std::vector<test::Wall> walls_;
  std::unique_ptr<Keyframe> keyframe_;
  std::int64_t steps_ = 0;
};

inline Se3 camera(double x, double y, double heading) {
  return test::camera_at({x, y, 1.2}, heading);
}

}  // namespace maplet::test
