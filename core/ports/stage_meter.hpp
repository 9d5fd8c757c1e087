// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "core/base/deadline.hpp"

namespace maplet {

/// What is timed, in the order of the data path. kFrame runs from pixels in memory to the step's
/// result; kSource is reading and decoding.
enum class Stage : std::uint8_t {
  kSource,
  kPatches,
  kOdometry,
  kMaplet,
  kRegistration,
  kSkeleton,
  kExchange,
  kFrame,
};

inline constexpr std::size_t kStages = 8;
inline constexpr std::array<std::string_view, kStages> kStageNames{
    "source", "patches", "odometry", "maplet", "registration", "skeleton", "exchange", "frame"};

/// Measures stages. The estimator reports to it and never looks at it: results do not depend on it.
class StageMeter {
 public:
  virtual ~StageMeter() = default;
  virtual void begin(Stage stage) noexcept = 0;
  /// @param budget  what the stage was given; longer than that is a miss
  virtual void end(Stage stage, Duration budget) noexcept = 0;
};

/// Times the scope it lives in.
class StageScope {
 public:
  StageScope(StageMeter& meter, Stage stage, Duration budget) noexcept
      : meter_{meter}, stage_{stage}, budget_{budget} {
    meter_.begin(stage_);
  }
  ~StageScope() { meter_.end(stage_, budget_); }
  StageScope(const StageScope&) = delete;
  StageScope& operator=(const StageScope&) = delete;

 private:
  StageMeter& meter_;
  Stage stage_;
  Duration budget_;
};

}  // namespace maplet
