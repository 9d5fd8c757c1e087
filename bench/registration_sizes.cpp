// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Bytes of maplets, what they replace, and how well they stand for it.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "bench/registration_fidelity.hpp"
#include "bench/registration_modes.hpp"

namespace maplet::bench {

namespace {

void print_size(std::span<const TrueRun> runs) {
  for (const TrueRun& run : runs) {
    double sum = 0.0;
    double most = 0.0;
    double planes = 0.0;
    for (const TrueMaplet& m : run.maplets) {
      const auto bytes = static_cast<double>(m.bytes);
      sum += bytes;
      most = std::max(most, bytes);
      planes += static_cast<double>(m.maplet->planes.size());
    }
    const double count = std::max<double>(1.0, static_cast<double>(run.maplets.size()));
    fmt::print("{}: {} maplets, bytes mean {:.0f} max {:.0f}, planes mean {:.0f}\n", run.folder,
               run.maplets.size(), sum / count, most, planes / count);
  }
}

void print_fidelity(std::span<const TrueRun> runs) {
  for (const TrueRun& run : runs) {
    const Fidelity f = fidelity_of(run);
    fmt::print(
        "{}: {:.1f} % of {} points within 2 cm, rms {:.1f} mm; {} of {} cells ({:.2f} %) "
        "looked through\n",
        run.folder, 100.0 * static_cast<double>(f.near) / static_cast<double>(f.points), f.points,
        1e3 * std::sqrt(f.squares_m2 / static_cast<double>(f.near)), f.free, f.cells,
        100.0 * static_cast<double>(f.free) / static_cast<double>(f.cells));
  }
}

}  // namespace

void report_size(const Options&, const Runs& runs) { print_size(runs); }

void report_fidelity(const Options&, const Runs& runs) { print_fidelity(runs); }

void report_knob(const Options&, const Runs& runs) {
  for (const std::size_t budget : {1024, 2048, 4096, 15360}) {
    for (const TrueRun& run : runs) {
      const TrueRun part = within(run, budget);
      fmt::print("within {} bytes, ", budget);
      print_size({&part, 1});
      print_fidelity({&part, 1});
    }
  }
}

}  // namespace maplet::bench
