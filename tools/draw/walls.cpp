// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/draw/walls.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <map>

namespace maplet::draw {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kBin_m = 0.06;
constexpr double kSample_m = 0.03;
constexpr int kGapBins = 2;
constexpr double kMinLength_m = 0.10;
constexpr double kMinHigh_m = 0.06;
constexpr double kTall_m = 0.9;  // a stretch ends where a wall becomes a low thing

}  // namespace

std::vector<WallStretch> stretches_of(const files::Surface& surface) {
  const Vector2d across = surface.plane.n.head<2>().normalized();
  const Vector2d along{-across.y(), across.x()};
  struct Bin {
    double area_m2 = 0.0;
    double off_m = 0.0;  // across, weighted with the area
  };
  std::map<int, Bin> bins;
  for (const files::Strip& strip : surface.strips) {
    int samples = 0;
    sample(strip, kSample_m, [&](const Vector3d&) { ++samples; });
    const double area_m2 = strip.along.cross(strip.across).norm() / samples;
    sample(strip, kSample_m, [&](const Vector3d& p) {
      Bin& bin = bins[static_cast<int>(std::floor(along.dot(p.head<2>()) / kBin_m))];
      bin.area_m2 += area_m2;
      bin.off_m += area_m2 * across.dot(p.head<2>());
    });
  }
  std::erase_if(bins, [](const auto& item) { return item.second.area_m2 < kMinHigh_m * kBin_m; });

  std::vector<WallStretch> out;
  for (auto first = bins.begin(); first != bins.end();) {
    auto last = first;
    double area_m2 = 0.0;
    double off_m = 0.0;
    int count = 0;
    const bool tall = first->second.area_m2 > kTall_m * kBin_m;
    auto end = first;
    for (; end != bins.end() && end->first - last->first <= kGapBins; ++end) {
      // One odd bin does not end a stretch.
      const auto after = std::next(end);
      const auto is_tall = [](const auto& item) { return item->second.area_m2 > kTall_m * kBin_m; };
      if (is_tall(end) != tall && (after == bins.end() || is_tall(after) != tall)) break;
      area_m2 += end->second.area_m2;
      off_m += end->second.off_m;
      ++count;
      last = end;
    }
    if (end == first) ++end;  // a lone bin of the other kind
    const double from = first->first * kBin_m;
    const double to = (last->first + 1) * kBin_m;
    if (count > 0 && to - from >= kMinLength_m) {
      const Vector2d foot = off_m / area_m2 * across;
      out.push_back({foot + from * along, foot + to * along, area_m2 / (count * kBin_m)});
    }
    first = end;
  }
  return out;
}

}  // namespace maplet::draw
