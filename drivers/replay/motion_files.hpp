// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <vector>

#include "core/base/clock.hpp"
#include "core/frame/motion_path.hpp"
#include "core/geometry/se3.hpp"

namespace maplet {

/// A line: its stamp and the numbers behind it.
struct MotionRow {
  static constexpr std::size_t kMost = 43;  ///< a pose and 36 of its covariance
  Stamp stamp;
  std::array<double, kMost> values;
  std::size_t count = 0;
};

/// What may stand beside a recording: odometry.txt (TUM lines, `stamp x y z qx qy qz qw`: the
/// camera in the odometry's own frame; or twists, `stamp vx vy vz wx wy wz`: m/s and rad/s in the
/// camera's axes) and gyro.txt (`stamp wx wy wz`, rad/s, camera's axes). Behind a pose may stand
/// the covariance of the motion since the line before, behind a twist its own: six variances or 36
/// numbers, row by row, tangent [rho; theta] of the camera. `#` begins a comment. Lines out of
/// order are sorted; those without sense, and the second one of a stamp, are skipped and counted.
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
  /// Of which file, how many, which line first; empty when none was.
  [[nodiscard]] const std::string& skipped_where() const noexcept { return skipped_where_; }

 private:
  struct Turn {  // the gyro's rates, integrated
    Stamp stamp;
    Eigen::Quaterniond q;
  };

  [[nodiscard]] bool read_pose(const MotionRow& row, MotionPose& pose) const noexcept;
  [[nodiscard]] bool read_twist(const MotionRow& row, Vector6d& last,
                                MotionPose& pose) const noexcept;
  void note_skipped(const char* file, std::size_t lines, std::size_t first);

  std::vector<MotionPose> poses_;
  std::vector<Turn> turns_;
  std::size_t skipped_ = 0;
  std::string skipped_where_;
};

}  // namespace maplet
