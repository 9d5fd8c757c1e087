// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "tools/eval/evaluate.hpp"
#include "tools/mapletctl/command.hpp"

namespace maplet::ctl {
namespace {

using Json = nlohmann::ordered_json;

struct Options {
  std::string truth;
  std::string estimate;
  bool json = false;
};

[[nodiscard]] Json to_json(const eval::RelativeError& error) {
  if (error.count == 0) return {{"m", nullptr}, {"deg", nullptr}};
  return {{"m", error.m}, {"deg", error.deg}};
}

void print_json(const eval::Evaluation& e) {
  const Json line{{"ate_rms_m", e.ate_rms_m},
                  {"ate_max_m", e.ate_max_m},
                  {"rpe_frame", to_json(e.rpe_frame)},
                  {"rpe_1s", to_json(e.rpe_1s)},
                  {"path_m", e.path_m},
                  {"pairs", e.pairs}};
  fmt::print("{}\n", line.dump());
}

void print_row(const char* name, const eval::RelativeError& error) {
  if (error.count == 0) {
    fmt::print("{:<16}{:>12}{:>12}\n", name, "-", "-");
  } else {
    fmt::print("{:<16}{:>10.1f} mm{:>8.2f} deg\n", name, error.m * 1e3, error.deg);
  }
}

void print_table(const eval::Evaluation& e, std::size_t estimates) {
  fmt::print("{:<16}{:>10.1f} mm   largest {:.1f} mm, {:.2f} % of the path\n", "ATE rms",
             e.ate_rms_m * 1e3, e.ate_max_m * 1e3,
             e.path_m > 0.0 ? 100.0 * e.ate_rms_m / e.path_m : 0.0);
  print_row("RPE per frame", e.rpe_frame);
  print_row("RPE over 1 s", e.rpe_1s);
  fmt::print("{:<16}{:>10.2f} m\n", "path", e.path_m);
  fmt::print("{:<16}{:>10}    of {} estimated poses\n", "pairs", e.pairs, estimates);
}

void run(const Options& options) {
  const eval::Trajectory truth = eval::read_tum(options.truth);
  const eval::Trajectory estimate = eval::read_tum(options.estimate);
  eval::Evaluation result;
  try {
    result = eval::evaluate(eval::associate(truth, estimate));
  } catch (const std::runtime_error& e) {
    throw Failure{fmt::format("{} against {}: {}", options.estimate, options.truth, e.what())};
  }
  options.json ? print_json(result) : print_table(result, estimate.size());
}

}  // namespace

void add_eval(Command app) {
  auto options = std::make_shared<Options>();
  const Command command = app.add_command(
      "eval",
      "Compares an estimated trajectory with the truth: absolute error (ATE, after a rigid "
      "alignment without scale) and relative error (RPE) per frame and over 1 s, all rms");
  command.add_option("--truth", options->truth, "TUM file: stamp x y z qx qy qz qw")
      .required()
      .type_name("FILE");
  command.add_option("--estimate", options->estimate, "TUM file, for example trajectory.tum")
      .required()
      .type_name("FILE");
  command.add_flag("--json", options->json, "One line of JSON");
  command.footer(
      "Examples:\n"
      "  mapletctl eval --estimate out/run/trajectory.tum --truth DIR/groundtruth.txt");
  command.run([options] { run(*options); });
}

}  // namespace maplet::ctl
