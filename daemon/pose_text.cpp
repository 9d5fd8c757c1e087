// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/pose_text.hpp"

#include <array>
#include <charconv>
#include <cmath>

namespace maplet::daemon {

std::optional<Se3> pose_of(std::string_view text) {
  std::array<double, 7> n{};
  for (std::size_t i = 0; i < n.size(); ++i) {
    while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), n[i]);
    if (error != std::errc{} || !std::isfinite(n[i])) return {};
    text.remove_prefix(static_cast<std::size_t>(end - text.data()));
    const bool last = i + 1 == n.size();
    if (last != text.empty() || (!last && text.front() != ',')) return {};
    if (!last) text.remove_prefix(1);
  }
  Se3 pose;
  pose.t = {n[0], n[1], n[2]};
  pose.q = {n[6], n[3], n[4], n[5]};
  if (std::abs(pose.q.norm() - 1.0) > 0.01) return {};
  pose.q.normalize();
  return pose;
}

}  // namespace maplet::daemon
