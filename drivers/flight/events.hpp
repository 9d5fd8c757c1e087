// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <span>

#include "core/frame/depth_frame.hpp"
#include "core/frame/image_size.hpp"
#include "core/limits.hpp"

namespace maplet::flight {

/// What reached the estimator's thread from outside, in the order it asked. A tag, a length of two
/// octets, a body. Numbers are for ever.
enum class Event : std::uint8_t {
  kClock = 1,    ///< i64 ns
  kFrame = 2,    ///< then blocks with its pixels
  kNoFrame = 3,  ///< u8 ErrorCode
  kBudget = 4,   ///< i64 ns
  kDelta = 5,    ///< a record as on the radio
  kRange = 6,    ///< a record as on the radio
  kMaplet = 7,   ///< u16 agent, u32 epoch, u32 id, u8 own; pieces of its bytes follow as kBytes
  kBytes = 8,
  kMeasured = 9,   ///< a range that a program measured
  kFlag = 10,      ///< u8
  kSay = 11,       ///< a closure that an operator vouches for
  kDecide = 12,    ///< an operator's verdict
  kOffset = 13,    ///< i64 ns: the difference of two clocks
  kStop = 14,      ///< the loop is over
  kMark = 15,      ///< once more round a loop that waits
  kRestored = 16,  ///< that was all of earlier runs
};

inline constexpr std::size_t kEventHead = 3;  ///< tag and length
inline constexpr std::size_t kMostBody = 2048;

/// The numbers of a frame, without its pixels.
struct FrameNumbers {
  DepthFrame frame;  ///< views without pixels
  bool gray = false;
  bool beside = false;
};

class Body {
 public:
  explicit Body(std::span<std::byte> bytes) noexcept : bytes_{bytes} {}
  template <class Number>
  void number(Number& value, bool write) noexcept {
    if (at_ + sizeof value > bytes_.size()) {
      good_ = false;
      return;
    }
    if (write) {
      std::memcpy(bytes_.data() + at_, &value, sizeof value);
    } else {
      std::memcpy(&value, bytes_.data() + at_, sizeof value);
    }
    at_ += sizeof value;
  }
  void flag(bool& value, bool write) noexcept {  // an octet: not each is a bool
    std::uint8_t octet = value ? 1 : 0;
    number(octet, write);
    value = octet != 0;
  }
  [[nodiscard]] bool good() const noexcept { return good_; }
  [[nodiscard]] std::size_t size() const noexcept { return at_; }

 private:
  std::span<std::byte> bytes_;
  std::size_t at_ = 0;
  bool good_ = true;
};

/// Both ways, so that they cannot differ.
inline void visit(Body& b, FrameNumbers& f, bool write) noexcept {
  const auto camera = [&](CameraModel& c) {
    b.number(c.width_px, write);
    b.number(c.height_px, write);
    for (double* v : {&c.fx_px, &c.fy_px, &c.cx_px, &c.cy_px}) b.number(*v, write);
  };
  const auto pose = [&](Se3& T) {
    for (int i = 0; i < 3; ++i) b.number(T.t[i], write);
    for (int i = 0; i < 4; ++i) b.number(T.q.coeffs()[i], write);
  };
  DepthFrame& d = f.frame;
  b.number(d.index, write);
  std::int64_t stamp = d.stamp.count();
  b.number(stamp, write);
  d.stamp = Stamp{stamp};
  b.number(d.depth.width_px, write);
  b.number(d.depth.height_px, write);
  b.number(d.metres_per_unit, write);
  camera(d.camera);
  b.number(d.noise.kind, write);
  for (double* v : {&d.noise.disparity_k, &d.noise.tof_floor_m, &d.noise.tof_slope,
                    &d.noise.correlated_px, &d.noise.lateral_px, &d.noise.disparity_step})
    b.number(*v, write);
  b.flag(f.gray, write);
  b.flag(f.beside, write);
  b.number(d.gray_beside.pixels.width_px, write);
  b.number(d.gray_beside.pixels.height_px, write);
  camera(d.gray_beside.camera);
  pose(d.gray_beside.T_depth_gray);
  b.flag(d.motion.has_pose, write);
  pose(d.motion.T_external_camera);
  for (int i = 0; i < 36; ++i) b.number(d.motion.path_covariance.data()[i], write);
  b.flag(d.motion.has_turn, write);
  for (int i = 0; i < 4; ++i) b.number(d.motion.q_gyro_camera.coeffs()[i], write);
}

/// Whether a file's numbers can be a frame's. @param most  the largest image that there is room for
[[nodiscard]] inline bool sane(const FrameNumbers& f, ImageSize most) noexcept {
  const DepthFrame& d = f.frame;
  const auto is_size = [](int w, int h) {
    return w > 0 && h > 0 && w <= static_cast<int>(kMaxWidthPx) &&
           h <= static_cast<int>(kMaxHeightPx);
  };
  const auto is_turn = [](const Eigen::Quaterniond& q) {
    return std::abs(q.coeffs().norm() - 1.0) < 0.01;
  };
  const auto is_pose = [&](const Se3& T) { return T.t.allFinite() && is_turn(T.q); };
  const auto is_camera = [](const CameraModel& c, int w, int h) {
    return c.valid() && c.width_px == w && c.height_px == h;
  };
  const auto& beside = d.gray_beside;
  return is_size(d.depth.width_px, d.depth.height_px) &&
         most.holds(d.depth.width_px, d.depth.height_px) && d.metres_per_unit > 0.0 &&
         std::isfinite(d.metres_per_unit) &&
         is_camera(d.camera, d.depth.width_px, d.depth.height_px) &&
         d.noise.kind <= NoiseModel::Kind::kTimeOfFlight &&
         (!f.beside || (is_size(beside.pixels.width_px, beside.pixels.height_px) &&
                        is_camera(beside.camera, beside.pixels.width_px, beside.pixels.height_px) &&
                        is_pose(beside.T_depth_gray))) &&
         (!d.motion.has_pose ||
          (is_pose(d.motion.T_external_camera) && d.motion.path_covariance.allFinite())) &&
         (!d.motion.has_turn || is_turn(d.motion.q_gyro_camera));
}

}  // namespace maplet::flight
