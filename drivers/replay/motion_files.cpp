// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/motion_files.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>

#include "drivers/replay/text.hpp"

namespace maplet {

namespace {

constexpr std::size_t kMaxBytes = std::size_t{256} << 20;
constexpr double kMaxRate = 100.0;  // rad/s
constexpr double kFar = 1e6;        // m

std::string_view next_word(std::string_view& line) noexcept {
  const auto begin = line.find_first_not_of(" \t\r,");
  if (begin == std::string_view::npos) return line = {};
  line.remove_prefix(begin);
  const std::string_view word = line.substr(0, line.find_first_of(" \t\r,"));
  line.remove_prefix(word.size());
  return word;
}

using Row = MotionRow;

std::optional<Row> row_of(std::string_view line) {
  Row row{};
  const auto stamp = parse_stamp(next_word(line));
  if (!stamp) return {};
  row.stamp = *stamp;
  for (std::string_view word = next_word(line); !word.empty(); word = next_word(line)) {
    double value = 0.0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc{} || end != word.data() + word.size() || !std::isfinite(value) ||
        row.count == MotionRow::kMost) {
      return {};
    }
    row.values[row.count++] = value;
  }
  return row;
}

// Nothing, six variances or 36 numbers row by row: what follows the first `first` values of a row.
bool covariance_of(const Row& row, std::size_t first, Matrix6d& out) noexcept {
  out.setZero();
  const std::size_t rest = row.count - first;
  const double* values = row.values.data() + first;
  if (rest == 6) out.diagonal() = Eigen::Map<const Vector6d>{values};
  if (rest == 36) out = Eigen::Map<const Matrix6d>{values};
  if (rest != 0 && rest != 6 && rest != 36) return false;
  if (!out.isApprox(out.transpose(), 1e-6)) return false;
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen{out, Eigen::EigenvaluesOnly};
  return eigen.eigenvalues()[0] >= -1e-12 * std::max(1.0, eigen.eigenvalues()[5]);
}

// Lines with their numbers, sorted by stamp: shuffled ones are put in order.
struct Rows {
  std::vector<Row> rows;
  std::size_t bad = 0;
  std::size_t first_bad = 0;  // line number, from 1
  void skip(std::size_t line) noexcept {
    if (bad++ == 0) first_bad = line;
  }
};

Rows rows_of(std::string_view text) {
  Rows out;
  for (std::size_t number = 1; !text.empty(); ++number) {
    std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(text.size(), line.size() + 1));
    line = line.substr(0, line.find('#'));
    if (line.find_first_not_of(" \t\r") == std::string_view::npos) continue;
    if (auto row = row_of(line)) {
      out.rows.push_back(*row);
    } else {
      out.skip(number);
    }
  }
  std::stable_sort(out.rows.begin(), out.rows.end(),
                   [](const Row& a, const Row& b) { return a.stamp < b.stamp; });
  return out;
}

// The two entries around `stamp` and how far between them it is; nothing outside or in a hole.
template <class Entry>
bool around(const std::vector<Entry>& entries, Stamp stamp, const Entry*& before,
            const Entry*& after, double& share) noexcept {
  const auto it =
      std::lower_bound(entries.begin(), entries.end(), stamp,
                       [](const Entry& entry, Stamp wanted) { return entry.stamp < wanted; });
  if (it == entries.end()) return false;
  after = before = &*it;
  share = 0.0;
  if (it->stamp == stamp) return true;
  if (it == entries.begin()) return false;
  before = &*std::prev(it);
  if (after->stamp - before->stamp > MotionFiles::kMostHole) return false;
  share = seconds(stamp - before->stamp) / seconds(after->stamp - before->stamp);
  return true;
}

}  // namespace

tl::expected<MotionFiles, std::string> MotionFiles::read(const std::filesystem::path& folder) {
  MotionFiles out;
  for (const char* name : {"odometry.txt", "gyro.txt"}) {
    const auto file = folder / name;
    std::error_code error;
    if (!std::filesystem::exists(file, error)) continue;
    const auto text = read_text(file, kMaxBytes);
    if (!text) return tl::unexpected<std::string>{text.error()};
    if (file.filename() == "gyro.txt") {
      out.parse_gyro(*text);
    } else {
      out.parse_odometry(*text);
    }
  }
  return out;
}

void MotionFiles::note_skipped(const char* file, std::size_t lines, std::size_t first) {
  if (lines == 0) return;
  skipped_ += lines;
  if (!skipped_where_.empty()) skipped_where_ += "; ";
  skipped_where_ += std::to_string(lines) + " lines of " + file + " make no sense";
  if (first > 0) skipped_where_ += ", the first is line " + std::to_string(first);
}

void MotionFiles::parse_odometry(std::string_view text) {
  Rows rows = rows_of(text);
  // Seven numbers and their covariance are a pose, six a twist: the file is of one kind.
  std::size_t poses = 0;
  for (const Row& row : rows.rows) poses += row.count == 7 || row.count == 13 || row.count == 43;
  const bool twists = 2 * poses < rows.rows.size();
  Vector6d last_twist = Vector6d::Zero();
  for (const Row& row : rows.rows) {
    MotionPose pose{row.stamp, {}, Matrix6d::Zero()};
    const bool read = twists ? read_twist(row, last_twist, pose) : read_pose(row, pose);
    if (!read || (!poses_.empty() && row.stamp <= poses_.back().stamp)) {
      ++rows.bad;
      continue;
    }
    poses_.push_back(pose);
  }
  note_skipped("odometry.txt", rows.bad, rows.first_bad);
}

// `x y z qx qy qz qw`, and the covariance of the motion since the line before.
bool MotionFiles::read_pose(const MotionRow& row, MotionPose& pose) const noexcept {
  const auto& v = row.values;
  Matrix6d step;
  if (row.count < 7 || !covariance_of(row, 7, step)) return false;
  const Eigen::Quaterniond q{v[6], v[3], v[4], v[5]};
  if (!(std::abs(q.norm() - 1.0) < 0.01)) return false;
  pose.T_external_camera = {q.normalized(), {v[0], v[1], v[2]}};
  if (!(pose.T_external_camera.t.cwiseAbs().maxCoeff() < kFar)) return false;
  pose.path_covariance = poses_.empty() ? step : Matrix6d{poses_.back().path_covariance + step};
  return true;
}

// `vx vy vz wx wy wz`, m/s and rad/s in the camera's axes, and its covariance: integrated by
// trapezoids. at() does not look into holes: what stands for them is of no consequence.
bool MotionFiles::read_twist(const MotionRow& row, Vector6d& last,
                             MotionPose& pose) const noexcept {
  Matrix6d of_twist;
  if (row.count < 6 || !covariance_of(row, 6, of_twist)) return false;
  const Vector6d twist = Eigen::Map<const Vector6d>{row.values.data()};
  if (!(twist.cwiseAbs().maxCoeff() < kMaxRate)) return false;
  if (!poses_.empty()) {
    const double dt = seconds(std::min(row.stamp - poses_.back().stamp, kMostHole));
    pose.T_external_camera = poses_.back().T_external_camera * Se3::exp(0.5 * dt * (last + twist));
    pose.path_covariance = poses_.back().path_covariance + dt * dt * of_twist;
  }
  last = twist;
  return true;
}

void MotionFiles::parse_gyro(std::string_view text) {
  Eigen::Vector3d last = Eigen::Vector3d::Zero();
  Rows rows = rows_of(text);
  for (const Row& row : rows.rows) {
    const Eigen::Vector3d rate{row.values[0], row.values[1], row.values[2]};
    if (row.count < 3 || !(rate.cwiseAbs().maxCoeff() < kMaxRate) ||
        (!turns_.empty() && row.stamp <= turns_.back().stamp)) {
      ++rows.bad;
      continue;
    }
    Turn turn{row.stamp, Eigen::Quaterniond::Identity()};
    if (!turns_.empty()) {
      // at() does not look into holes: what stands for them is of no consequence.
      const Duration dt = std::min(row.stamp - turns_.back().stamp, kMostHole);
      Vector6d xi;
      xi << Eigen::Vector3d::Zero(), 0.5 * (last + rate) * seconds(dt);
      turn.q = (turns_.back().q * Se3::exp(xi).q).normalized();
    }
    turns_.push_back(turn);
    last = rate;
  }
  note_skipped("gyro.txt", rows.bad, rows.first_bad);
}

MotionHint MotionFiles::at(Stamp stamp) const noexcept {
  MotionHint hint;
  double share = 0.0;
  const MotionPose* pose_before = nullptr;
  const MotionPose* pose_after = nullptr;
  if (around(poses_, stamp, pose_before, pose_after, share))
    hint = between(*pose_before, *pose_after, share);
  const Turn* turn_before = nullptr;
  const Turn* turn_after = nullptr;
  if (around(turns_, stamp, turn_before, turn_after, share)) {
    hint.has_turn = true;
    hint.q_gyro_camera = turn_before->q.slerp(share, turn_after->q);
  }
  return hint;
}

}  // namespace maplet
