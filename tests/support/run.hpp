// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/support/patience.hpp"
#include "tests/support/process.hpp"

namespace maplet::test {

/// mapletd on a source, into a folder, without DDS.
inline Finished map_it(const std::string& source, const std::filesystem::path& out,
                       std::vector<std::string> more = {},
                       std::chrono::seconds limit = std::chrono::seconds{300}) {
  std::vector<std::string> command{"mapletd", "--source",   source,
                                   "--out",   out.string(), "--no-dds"};
  if (patience() > 1)  // a frame's budget is a wall clock's limit, too
    command.insert(command.end(), {"--set", "frame.budget_us=1000000"});
  command.insert(command.end(), more.begin(), more.end());
  return run(command, limit);
}

inline std::string text_of(const std::filesystem::path& file) {
  std::ifstream in{file, std::ios::binary};
  return {std::istreambuf_iterator<char>{in}, {}};
}

inline nlohmann::json report_of(const std::filesystem::path& out) {
  return nlohmann::json::parse(text_of(out / "report.json"));
}

/// `mapletctl eval --json` of one of the run's trajectories.
inline nlohmann::json errors_of(const std::filesystem::path& out, const std::string& trajectory,
                                const std::filesystem::path& truth) {
  const Finished eval = run({"mapletctl", "eval", "--truth", truth.string(), "--estimate",
                             (out / trajectory).string(), "--json"});
  EXPECT_EQ(eval.exit_code, 0) << eval.err;
  return nlohmann::json::parse(eval.out);
}

}  // namespace maplet::test
