// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/registration/usual_fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace maplet {

namespace {

constexpr double kBinsPerOctave = 4.0;
constexpr double kFirstOctave = -10.0;
constexpr double kQuantile = 0.9;
constexpr double kTimes = 2.5;  // other views, the first half of a place with the second
constexpr double kLeast = 0.7;  // consecutive ones share keyframes, and with them their noise

}  // namespace

void UsualFit::note(double chi2_per_dof) noexcept {
  if (!std::isfinite(chi2_per_dof)) return;
  const double at = kBinsPerOctave * (std::log2(std::max(chi2_per_dof, 1e-9)) - kFirstOctave);
  ++bins_[static_cast<std::size_t>(std::clamp(at, 0.0, kBins - 1.0))];
  ++count_;
}

double UsualFit::limit() const noexcept {
  if (count_ == 0) return std::numeric_limits<double>::infinity();
  const auto wanted = static_cast<std::uint32_t>(std::ceil(kQuantile * count_));
  std::uint32_t seen = 0;
  int bin = 0;
  while ((seen += bins_[static_cast<std::size_t>(bin)]) < wanted) ++bin;
  const double usual = std::exp2((bin + 1) / kBinsPerOctave + kFirstOctave);  // the bin's end
  return std::max(kLeast, kTimes * usual);
}

}  // namespace maplet
