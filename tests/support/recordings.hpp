// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>

namespace maplet::test {

/// The folder of real recordings: MAPLET_DATA, default ../shared/data beside the project.
inline std::filesystem::path data_dir() {
  if (const char* set = std::getenv("MAPLET_DATA")) return set;
  const char* source = std::getenv("MAPLET_SOURCE_DIR");
  return std::filesystem::path{source ? source : "."} / "../shared/data";
}

}  // namespace maplet::test

/// Path of a real recording; the test is SKIPPED where it is not there.
#define MAPLET_RECORDING(variable, relative)                                  \
  const std::filesystem::path variable = maplet::test::data_dir() / relative; \
  if (!std::filesystem::exists(variable)) GTEST_SKIP() << "SKIPPED: no " << variable
