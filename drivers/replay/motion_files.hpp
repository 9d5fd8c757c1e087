// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <vector>

#include "core/base/clock.hpp"
#include "core/frame/motion_hint.hpp"
#include "core/geometry/se3.hpp"

namespace maplet {

/// What may stand beside a recording: odometry.txt (TUM lines, `stamp x y z qx qy qz qw`: the
/// camera in the odometry's own frame) and gyro.txt (`stamp wx wy wz`, rad/s, camera's axes). `#`
/// begins a comment. Lines without sense and stamps that do not go forward are skipped and counted.
///
/// Memory   allocates when it reads; at() does not.
class MotionFiles {
 public:
  /// Longer holes are not bridged: there is no hint in them.
  static constexpr Duration kMostHole = std::chrono::milliseconds{200};

  /// @return what is there (nothing is fine), or one line: a file that cannot be read
  [[nodiscard]] static tl::expected<MotionFiles, std::string> read(
      const std::filesystem::path& folder);
  void parse_odometry(std::string_view text);
  void parse_gyro(std::string_view text);

  /// Interpolated to `stamp`. Time: O(log lines).
  [[nodiscard]] MotionHint at(Stamp stamp) const noexcept;

  [[nodiscard]] std::size_t poses() const noexcept { return poses_.size(); }
  [[nodiscard]] std::size_t rates() const noexcept { return turns_.size(); }
  [[nodiscard]] std::size_t skipped() const noexcept { return skipped_; }

 private:
  struct Pose {
    Stamp stamp;
    Se3 T_external_camera;
  };
  struct Turn {  // the gyro's rates, integrated
    Stamp stamp;
    Eigen::Quaterniond q;
  };

  std::vector<Pose> poses_;
  std::vector<Turn> turns_;
  std::size_t skipped_ = 0;
};

}  // namespace maplet
