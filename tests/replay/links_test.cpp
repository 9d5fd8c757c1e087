// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// What the delta-poses between consecutive maplets say of their own errors, against the truth.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <sstream>
#include <vector>

#include "tests/support/run.hpp"
#include "tests/support/temp_dir.hpp"
#include "tools/eval/evaluate.hpp"

namespace maplet::test {
namespace {

Se3 pose_of(const nlohmann::json& json) {
  const auto v = json.get<std::vector<double>>();
  return {Eigen::Quaterniond{v[6], v[3], v[4], v[5]}.normalized(),
          Eigen::Vector3d{v[0], v[1], v[2]}};
}

Se3 truth_at(const eval::Trajectory& truth, double stamp_s) {
  const auto apart = [&](const eval::StampedPose& p) {
    return std::abs(seconds(p.stamp - Stamp{}) - stamp_s);
  };
  return std::min_element(truth.begin(), truth.end(),
                          [&](const auto& a, const auto& b) { return apart(a) < apart(b); })
      ->pose;
}

struct Nees {
  int links = 0;
  double mean = 0.0;  // per degree of freedom
};

Nees nees_of_links(const std::filesystem::path& out, const eval::Trajectory& truth) {
  Nees nees;
  std::istringstream lines{text_of(out / "delta_poses.jsonl")};
  for (std::string line; std::getline(lines, line);) {
    const auto delta = nlohmann::json::parse(line);
    if (delta["type"] != "delta_pose" || delta["kind"] != "consecutive") continue;
    const Se3 moved =
        truth_at(truth, delta["stamp_a_s"]).inverse() * truth_at(truth, delta["stamp_b_s"]);
    const Vector6d error = (pose_of(delta["T_a_b"]).inverse() * moved).log();
    Matrix6d covariance;
    const auto entries = delta["covariance"].get<std::vector<double>>();
    for (int i = 0; i < 36; ++i) covariance(i / 6, i % 6) = entries[static_cast<std::size_t>(i)];
    nees.mean += error.dot(covariance.ldlt().solve(error)) / 6.0;
    ++nees.links;
  }
  if (nees.links > 0) nees.mean /= nees.links;
  return nees;
}

// 3.0 and 2.3 where points of intensity were all off to one side and weights counted as if they
// stayed.
TEST(Links, KnowHowFarTheyAreOff) {
  const TempDir dir;
  double mean = 0.0;
  for (const char* seed : {"2", "41"}) {
    const std::string world = std::string{"sim:loop?rate_hz=15&frames=700&width=640&seed="} + seed;
    const auto truth = dir / (std::string{"truth"} + seed);
    ASSERT_EQ(
        run({"mapletctl", "simulate", world, "--out", truth.string(), "--truth-only"}).exit_code,
        0);
    const Finished mapped = map_it(world, dir / seed, {"--pace", "fast"});
    ASSERT_EQ(mapped.exit_code, 0) << mapped.err;
    const Nees nees = nees_of_links(dir / seed, eval::read_tum(truth / "groundtruth.txt"));
    RecordProperty(std::string{"nees_"} + seed, std::to_string(nees.mean));
    EXPECT_GE(nees.links, 7) << world;
    mean += 0.5 * nees.mean;
  }
  EXPECT_GE(mean, 0.5);
  EXPECT_LE(mean, 2.0);
}

}  // namespace
}  // namespace maplet::test
