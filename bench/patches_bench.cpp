// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Patches over sources: what a time budget buys. One CSV line a budget; 0 = none.
//
//   patches_bench tum:../shared/data/rgbd/redkitchen_a > real.csv
//   patches_bench 'sim:room?frames=100' 'sim:loop?frames=100' > simulated.csv
//   bench/plot_budget recording=real.csv simulated=simulated.csv > docs/patches_budget.svg
#include <fmt/core.h>
#include <time.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <memory>
#include <vector>

#include "core/frame/decimator.hpp"
#include "core/patches/extractor.hpp"
#include "drivers/open_source.hpp"
#include "tools/eval/patch_score.hpp"
#include "tools/mapletctl/patch_truth.hpp"

namespace {

using namespace maplet;
using eval::mean;
using eval::quantile;

struct Options {
  std::vector<std::string> sources;
  std::vector<int> budgets_us{50,  75,   100,  150,  200,  300,  500,
                              700, 1000, 1500, 2000, 3000, 5000, 0};
  int decimate = 1;
  bool cpu_budget = false;
};

/// Budgets in thread CPU time: for a machine that does other things too.
class CpuClock final : public Clock {
 public:
  [[nodiscard]] Instant now() const noexcept override {
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return Instant{std::chrono::seconds{t.tv_sec} + Duration{t.tv_nsec}};
  }
};

double clock_us(clockid_t id) {
  timespec t{};
  clock_gettime(id, &t);
  return 1e6 * static_cast<double>(t.tv_sec) + 1e-3 * static_cast<double>(t.tv_nsec);
}

struct Budget {
  int us;
  eval::PatchScore score;
  std::vector<double> cpu_us, overrun_us;
};

void run_one(PatchExtractor& extractor, const DepthFrame& frame, ctl::PatchTruth* truth,
             bool cpu_budget, Budget& budget) {
  static const MonotonicClock wall_clock;
  static const CpuClock cpu_clock;
  const Clock& clock = cpu_budget ? static_cast<const Clock&>(cpu_clock) : wall_clock;
  const Instant start = clock.now();
  const double cpu = clock_us(CLOCK_THREAD_CPUTIME_ID);
  const Deadline deadline =
      budget.us == 0 ? Deadline::never() : Deadline{clock, std::chrono::microseconds{budget.us}};
  const PatchSet& set = extractor.run(frame, deadline);
  budget.cpu_us.push_back(clock_us(CLOCK_THREAD_CPUTIME_ID) - cpu);
  const double took_us = std::chrono::duration<double, std::micro>{clock.now() - start}.count();
  budget.overrun_us.push_back(budget.us == 0 ? 0.0 : std::max(0.0, took_us - budget.us));
  std::vector<std::uint16_t> labels(
      static_cast<std::size_t>(frame.depth.width_px * frame.depth.height_px));
  extractor.write_labels(frame, labels);
  budget.score.add(frame, set, labels);
  if (truth == nullptr) return;
  budget.score.add_truth(frame, set, labels, truth->labels(frame),
                         [&](std::uint16_t label) { return truth->plane(label); });
}

/// Every budget on each frame, so that what else the machine does falls on all of them.
void run_source(const std::string& uri, const Options& options, std::vector<Budget>& budgets) {
  auto source = open_source(uri, {});
  if (!source) throw std::runtime_error{source.error().what};
  const auto truth = options.decimate == 1 ? ctl::PatchTruth::of(uri, **source) : nullptr;
  Arena arena;
  Decimator decimator{{options.decimate}, arena};
  PatchExtractor extractor{PatchConfig{}, arena};
  while (const auto next = (*source)->next(Deadline::never())) {
    const DepthFrame frame = decimator.run(*next);
    for (Budget& budget : budgets)
      run_one(extractor, frame, truth.get(), options.cpu_budget, budget);
  }
}

void print(const Budget& b) {
  const eval::PatchScore& s = b.score;
  fmt::print("{},{},{:.4f},{:.4f},{:.4f},{:.4f},{:.3f},{:.4f},{:.1f},{:.1f},{:.1f}\n", b.us,
             s.frames, mean(s.coverage), s.within_3_sigma / std::max(1.0, s.labelled),
             s.regions == 0 ? 0.0 : static_cast<double>(s.correct) / static_cast<double>(s.regions),
             quantile(s.angle_deg, 0.5), quantile(s.offset_mm, 0.5), mean(s.plane_nees),
             quantile(b.cpu_us, 0.5), quantile(b.cpu_us, 0.95), quantile(b.overrun_us, 0.95));
}

}  // namespace

int main(int argc, char** argv) try {
  Options options;
  CLI::App app{"Coverage, error and time of the patches stage at many budgets, as CSV"};
  app.add_option("sources", options.sources, "Source URIs")->required();
  app.add_option("--budgets-us", options.budgets_us, "0 = no budget")->delimiter(',');
  app.add_flag("--cpu-budget", options.cpu_budget, "Budgets are thread CPU time, not wall time");
  app.add_option("--decimate", options.decimate)->check(CLI::IsMember({1, 2, 4}));
  CLI11_PARSE(app, argc, argv);
  std::vector<Budget> budgets;
  for (const int us : options.budgets_us) budgets.push_back({us, {}, {}, {}});
  for (const std::string& uri : options.sources) run_source(uri, options, budgets);
  fmt::print(
      "budget_us,frames,coverage,within_3_sigma,correct,angle_deg,offset_mm,nees,cpu_p50_us,"
      "cpu_p95_us,overrun_p95_us\n");
  for (const Budget& budget : budgets) print(budget);
  return 0;
} catch (const std::exception& error) {
  fmt::print(stderr, "patches_bench: {}\n", error.what());
  return 1;
}
