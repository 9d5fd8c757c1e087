// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <string>
#include <vector>

namespace maplet::bench {

/// What a deadline gives.
struct DeadlinePoint {
  double budget_us, p50_mm, p90_mm;
  double over_us;  ///< p95 of what it took beyond the budget
};

/// Error over deadline, both in log scale.
inline void write_deadline_plot(const std::string& file, const std::vector<DeadlinePoint>& curve) {
  constexpr double kWidth = 560, kHeight = 220, kLeft = 64, kTop = 30;
  constexpr double kLeast_mm = 1.0, kMost_mm = 1000.0;
  const double first = std::log(curve.front().budget_us);
  const double last = std::log(curve.back().budget_us);
  const auto x = [&](double us) {
    return kLeft + kWidth * (std::log(us) - first) / (last - first);
  };
  const auto y = [&](double mm) {
    const double share = std::log(std::clamp(mm, kLeast_mm, kMost_mm)) / std::log(kMost_mm);
    return kTop + kHeight * (1.0 - share);
  };
  std::string svg = fmt::format(
      "<svg xmlns='http://www.w3.org/2000/svg' width='{0}' height='{1}' font-family='sans-serif' "
      "font-size='12'><rect width='{0}' height='{1}' fill='white'/><text x='{2}' y='18'>ICaP: "
      "error "
      "of position at a deadline, guesses off by up to 0.5 m and 15 deg</text>",
      kLeft + kWidth + 60, kTop + kHeight + 40, kLeft);
  for (const double mm : {1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0}) {
    svg += fmt::format(
        "<path d='M{0} {1:.1f}h{2}' stroke='#ddd'/><text x='{3}' y='{4:.1f}' "
        "text-anchor='end'>{5:g} mm</text>",
        kLeft, y(mm), kWidth, kLeft - 6, y(mm) + 4, mm);
  }
  std::string p50;
  std::string p90;
  for (const DeadlinePoint& p : curve) {
    svg += fmt::format("<text x='{:.1f}' y='{}' text-anchor='middle'>{:g}</text>", x(p.budget_us),
                       kTop + kHeight + 16, p.budget_us);
    p50 += fmt::format("{:.1f},{:.1f} ", x(p.budget_us), y(p.p50_mm));
    p90 += fmt::format("{:.1f},{:.1f} ", x(p.budget_us), y(p.p90_mm));
  }
  svg += fmt::format(
      "<text x='{0}' y='{1}' text-anchor='end'>deadline, us of CPU time</text>"
      "<polyline fill='none' stroke='#1f77b4' stroke-width='2.5' points='{2}'/>"
      "<polyline fill='none' stroke='#d95f02' stroke-width='2.5' points='{3}'/>"
      "<text x='{4}' y='{5:.1f}' fill='#1f77b4'>median</text>"
      "<text x='{4}' y='{6:.1f}' fill='#d95f02'>9 of 10</text></svg>\n",
      kLeft + kWidth, kTop + kHeight + 32, p50, p90, kLeft + kWidth + 6,
      y(curve.back().p50_mm) + 12, y(curve.back().p90_mm) - 4);
  std::ofstream{file} << svg;
}

}  // namespace maplet::bench
