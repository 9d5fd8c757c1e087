// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/motion_files.hpp"

#include <algorithm>
#include <array>
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

template <std::size_t N>
struct Row {
  Stamp stamp;
  std::array<double, N> values;
};

template <std::size_t N>
std::optional<Row<N>> row_of(std::string_view line) {
  Row<N> row{};
  const auto stamp = parse_stamp(next_word(line));
  if (!stamp) return {};
  row.stamp = *stamp;
  for (double& value : row.values) {
    const std::string_view word = next_word(line);
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc{} || end != word.data() + word.size() || !std::isfinite(value)) {
      return {};
    }
  }
  return row;
}

// Calls take(row) for each line with sense; @return lines without.
template <std::size_t N, class Take>
std::size_t for_each_row(std::string_view text, Take&& take) {
  std::size_t bad = 0;
  while (!text.empty()) {
    std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(text.size(), line.size() + 1));
    line = line.substr(0, line.find('#'));
    if (line.find_first_not_of(" \t\r") == std::string_view::npos) continue;
    const auto row = row_of<N>(line);
    if (!row || !take(*row)) ++bad;
  }
  return bad;
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

void MotionFiles::parse_odometry(std::string_view text) {
  skipped_ += for_each_row<7>(text, [&](const Row<7>& row) {
    const auto& v = row.values;
    const Eigen::Quaterniond q{v[6], v[3], v[4], v[5]};
    const double length = q.norm();
    if (!(std::abs(length - 1.0) < 0.01)) return false;
    const Eigen::Vector3d t{v[0], v[1], v[2]};
    if (!(t.cwiseAbs().maxCoeff() < kFar)) return false;
    if (!poses_.empty() && row.stamp <= poses_.back().stamp) return false;
    poses_.push_back({row.stamp, {q.normalized(), t}});
    return true;
  });
}

void MotionFiles::parse_gyro(std::string_view text) {
  Eigen::Vector3d last = Eigen::Vector3d::Zero();
  skipped_ += for_each_row<3>(text, [&](const Row<3>& row) {
    const Eigen::Vector3d rate{row.values[0], row.values[1], row.values[2]};
    if (!(rate.cwiseAbs().maxCoeff() < kMaxRate)) return false;
    Turn turn{row.stamp, Eigen::Quaterniond::Identity()};
    if (!turns_.empty()) {
      if (row.stamp <= turns_.back().stamp) return false;
      // at() does not look into holes: what stands for them is of no consequence.
      const Duration dt = std::min(row.stamp - turns_.back().stamp, kMostHole);
      Vector6d xi;
      xi << Eigen::Vector3d::Zero(), 0.5 * (last + rate) * seconds(dt);
      turn.q = (turns_.back().q * Se3::exp(xi).q).normalized();
    }
    turns_.push_back(turn);
    last = rate;
    return true;
  });
}

MotionHint MotionFiles::at(Stamp stamp) const noexcept {
  MotionHint hint;
  double share = 0.0;
  const Pose* pose_before = nullptr;
  const Pose* pose_after = nullptr;
  if (around(poses_, stamp, pose_before, pose_after, share)) {
    const Se3& from = pose_before->T_external_camera;
    const Vector6d step = (from.inverse() * pose_after->T_external_camera).log();
    hint.has_pose = true;
    hint.T_external_camera = from * Se3::exp(share * step);
  }
  const Turn* turn_before = nullptr;
  const Turn* turn_after = nullptr;
  if (around(turns_, stamp, turn_before, turn_after, share)) {
    hint.has_turn = true;
    hint.q_gyro_camera = turn_before->q.slerp(share, turn_after->q);
  }
  return hint;
}

}  // namespace maplet
