// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/eval/segmentation.hpp"

#include <algorithm>
#include <map>

namespace maplet::eval {

namespace {

struct Regions {
  std::vector<std::uint32_t> of_pixel;  ///< index + 1; 0 = none
  std::vector<std::uint32_t> pixels;
  std::vector<std::uint16_t> label;
};

/// Floods one 8-connected set of equal labels with `id`.
std::uint32_t flood(std::span<const std::uint16_t> labels, int width, int start, std::uint32_t id,
                    std::vector<std::uint32_t>& of_pixel, std::vector<int>& stack) {
  const int height = static_cast<int>(labels.size()) / width;
  std::uint32_t count = 0;
  stack.assign(1, start);
  of_pixel[start] = id;
  while (!stack.empty()) {
    const int pixel = stack.back();
    stack.pop_back();
    ++count;
    for (int v = std::max(0, pixel / width - 1); v <= std::min(height - 1, pixel / width + 1);
         ++v) {
      for (int u = std::max(0, pixel % width - 1); u <= std::min(width - 1, pixel % width + 1);
           ++u) {
        const int next = v * width + u;
        if (of_pixel[next] != 0 || labels[next] != labels[start]) continue;
        of_pixel[next] = id;
        stack.push_back(next);
      }
    }
  }
  return count;
}

Regions connected(std::span<const std::uint16_t> labels, int width, int min_px) {
  constexpr std::uint32_t kSmall = 0xFFFFFFFF;
  Regions out;
  out.of_pixel.resize(labels.size());
  std::vector<int> stack;
  for (int pixel = 0; pixel < static_cast<int>(labels.size()); ++pixel) {
    if (labels[pixel] == 0 || out.of_pixel[pixel] != 0) continue;
    const auto id = static_cast<std::uint32_t>(out.pixels.size() + 1);
    const std::uint32_t count = flood(labels, width, pixel, id, out.of_pixel, stack);
    if (count >= static_cast<std::uint32_t>(min_px)) {
      out.pixels.push_back(count);
      out.label.push_back(labels[pixel]);
    } else {
      // Floods it again with a mark of its own: seen, not a region.
      std::replace(out.of_pixel.begin() + pixel, out.of_pixel.end(), id, kSmall);
    }
  }
  std::replace(out.of_pixel.begin(), out.of_pixel.end(), kSmall, std::uint32_t{0});
  return out;
}

}  // namespace

SegmentationScore score_segmentation(std::span<const std::uint16_t> truth,
                                     std::span<const std::uint16_t> found, int width,
                                     double overlap, int min_px) {
  const Regions regions = connected(truth, width, min_px);
  std::map<std::uint16_t, std::uint32_t> found_px;
  std::map<std::pair<std::uint32_t, std::uint16_t>, std::uint32_t> common;
  for (std::size_t k = 0; k < truth.size(); ++k) {
    if (found[k] == 0) continue;
    ++found_px[found[k]];
    if (regions.of_pixel[k] != 0) ++common[{regions.of_pixel[k] - 1, found[k]}];
  }
  SegmentationScore score;
  score.regions = regions.pixels.size();
  std::vector<bool> truth_done(score.regions);
  std::map<std::uint16_t, bool> found_done;
  struct Pieces {
    int count = 0;
    std::uint32_t pixels = 0;
    std::vector<std::uint32_t> who;
  };
  std::map<std::uint32_t, Pieces> pieces_of_truth;
  std::map<std::uint16_t, Pieces> pieces_of_found;
  for (const auto& [pair, pixels] : common) {
    const auto [t, f] = pair;
    const bool most_of_truth = pixels >= overlap * regions.pixels[t];
    const bool most_of_found = pixels >= overlap * found_px[f];
    if (most_of_truth && most_of_found) {
      score.correct.push_back({f, regions.label[t], regions.pixels[t]});
      truth_done[t] = found_done[f] = true;
    }
    if (most_of_found) {
      Pieces& p = pieces_of_truth[t];
      p.count += 1, p.pixels += pixels, p.who.push_back(f);
    }
    if (most_of_truth) {
      Pieces& p = pieces_of_found[f];
      p.count += 1, p.pixels += pixels, p.who.push_back(t);
    }
  }
  for (const auto& [t, p] : pieces_of_truth) {
    if (truth_done[t] || p.count < 2 || p.pixels < overlap * regions.pixels[t]) continue;
    ++score.over;
    truth_done[t] = true;
    for (const std::uint32_t f : p.who) found_done[static_cast<std::uint16_t>(f)] = true;
  }
  for (const auto& [f, p] : pieces_of_found) {
    if (found_done[f] || p.count < 2 || p.pixels < overlap * found_px[f]) continue;
    ++score.under;
    found_done[f] = true;
    for (const std::uint32_t t : p.who) truth_done[t] = true;
  }
  score.missed = static_cast<std::size_t>(std::count(truth_done.begin(), truth_done.end(), false));
  for (const auto& [f, pixels] : found_px) {
    score.noise += found_done[f] ? 0 : 1;
  }
  return score;
}

}  // namespace maplet::eval
