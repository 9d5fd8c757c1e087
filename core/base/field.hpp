// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "core/base/clock.hpp"

namespace maplet {

/// A vector, or nothing: written `[x, y, z]` or `"auto"`.
using Vector3OrAuto = std::optional<std::array<double, 3>>;

/// One configuration key of a stage: its place in the TOML file, its member, its range, its help.
///
/// A stage declares `static constexpr Field<Config> kFields[]` in its Config. The table feeds
/// the parser, the range check (NaN fails), --check-config, --print-config and the manual.
/// A Duration member is written in the unit that the key ends in (_ns, _us, _ms, _s); min and max
/// are in that unit. Of a vector they bound each number; bool and string members ignore them.
template <class Config>
struct Field {
  std::string_view key;  ///< without the stage's section: "gate_m"
  std::variant<bool Config::*, int Config::*, double Config::*, Duration Config::*,
               std::string Config::*, Vector3OrAuto Config::*>
      member;
  double min;
  double max;
  std::string_view help;          ///< one sentence, no full stop
  std::string_view choices = {};  ///< of a string or whole number: "auto|off", "1|2|4"; empty = any
};

}  // namespace maplet
