// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "core/base/static_vector.hpp"
#include "core/geometry/se3.hpp"

namespace maplet {

/// Where a camera may be that could be anywhere: rooms look alike, so one frame that fits one view
/// proves nothing. Places contend for several frames, each of which votes for those that it was
/// recognised at; one is believed when it has the votes, every view was asked, and no other comes
/// near. Far from where it is believed to be the camera must have moved between the votes, too: of
/// what looks alike from one place, little does from another.
///
/// Memory   inside the object. Time O(kMost). Threads one caller at a time.
/// Math     docs/math/odometry.md, section "Lost and found"
class Contenders {
 public:
  struct Place {
    Se3 T_odom_camera;
    std::uint32_t segment = 0;
    bool near = false;  ///< to where it is believed to be
  };

  void clear() noexcept { places_.clear(); }
  [[nodiscard]] bool empty() const noexcept { return places_.empty(); }

  /// A frame later. @param T_last_now  how the camera moved, where that is known
  void step(const Se3& T_last_now) noexcept;
  /// The present frame is recognised there.
  void vote(const Place& place) noexcept;
  /// Whether a place that this frame voted for has won.
  [[nodiscard]] bool won(const Place& place) const noexcept;

 private:
  static constexpr std::size_t kMost = 6;

  struct Contender {
    Place place;
    Se3 T_odom_first;  ///< of the first vote
    int votes = 0;
    int idle = 0;  ///< frames since the last one
  };
  [[nodiscard]] static bool has_fewer_votes(const Contender& a, const Contender& b) noexcept {
    return a.votes < b.votes;
  }
  [[nodiscard]] static bool same(const Contender& contender, const Place& place) noexcept;

  StaticVector<Contender, kMost> places_;
};

}  // namespace maplet
