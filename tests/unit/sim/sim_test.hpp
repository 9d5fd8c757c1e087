// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <string>

#include "drivers/sim/sim_source.hpp"

namespace maplet::test {

using Parameters = std::map<std::string, std::string>;

inline std::unique_ptr<SimSource> sim(const std::string& world, const Parameters& parameters) {
  auto source = open_sim(world, parameters);
  if (!source) {
    ADD_FAILURE() << source.error();
    std::abort();
  }
  return std::move(*source);
}

}  // namespace maplet::test
