// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Maplets against the truth: size, ICaP from guesses, finding places from nothing, deadlines.
//
//   registration_bench MODE FOLDER=SOURCE...    folders of mapletd --out and what they were made of
//     size       bytes and ratio to the point clouds they replace
//     fidelity   points of the keyframes on the maplets, cells that were looked through
//     pairs      overlapping pairs, guesses off by up to 0.5 m and 15 deg: errors, NEES, CPU time
//     judge      lines of `mapletctl match --json` of two runs (--lines FILE)
//     search     CPU time of a query among --stored maplets
//     deadline   ICaP's error at deadlines of so much CPU time (--plot FILE.svg)
//     knob       size and fidelity of what is sent within 1, 2, 4 and 15 KB
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <map>
#include <stdexcept>
#include <string>

#include "bench/registration_modes.hpp"

namespace {

using namespace maplet::bench;

const std::map<std::string, void (*)(const Options&, const Runs&)> kModes{
    {"size", report_size},        {"fidelity", report_fidelity}, {"knob", report_knob},
    {"pairs", report_pairs},      {"judge", report_judge},       {"search", report_search},
    {"deadline", report_deadline}};

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app{"Maplets against the truth"};
  app.add_option("mode", options.mode, "size, fidelity, knob, pairs, judge, search or deadline")
      ->required();
  app.add_option("runs", options.runs, "FOLDER=SOURCE: of mapletd --out, and made of what")
      ->required();
  app.add_option("--min-overlap", options.min_overlap, "Of pairs, share of the smaller maplet");
  app.add_option("--guesses", options.guesses, "For each pair");
  app.add_option("--lines", options.lines, "What mapletctl match --json printed");
  app.add_option("--plot", options.plot, "SVG of mode deadline");
  app.add_option("--stored", options.stored, "Maplets in the index");
  app.add_flag("--verified", options.verified,
               "Mode pairs: with the verdict, as mapletctl register");
  app.add_option("--uneven-m", options.registration.uneven_m, "As registration.uneven_m");
  app.add_option("--uneven-rad", options.registration.uneven_rad, "As registration.uneven_rad");
  app.add_flag("--verbose", options.verbose, "A line a try");
  CLI11_PARSE(app, argc, argv);
  try {
    Runs runs;
    for (const std::string& text : options.runs) runs.push_back(read_true_run(text));
    const auto mode = kModes.find(options.mode);
    if (mode == kModes.end()) throw std::runtime_error{"no such mode: " + options.mode};
    mode->second(options, runs);
  } catch (const std::exception& e) {
    fmt::print(stderr, "registration_bench: {}\n", e.what());
    return 1;
  }
  return 0;
}
