// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Says how far another agent is, as a program beside a ranging radio does.
#include <memory>
#include <vector>

#include "tools/mapletctl/command.hpp"
#include "transport/dds/range_topic.hpp"

namespace maplet::ctl {
namespace {

struct Options {
  DdsConfig dds;
  int agent = 1;
  int other = 0;
  double range_m = 0.0;
  double sigma_m = 0.1;
  double stamp_s = 0.0;
  std::vector<double> bearing;
  double bearing_sigma_rad = 0.05;
};

void run(const Options& options) {
  using std::chrono::seconds;
  RangeReport report;
  report.agent = static_cast<std::uint16_t>(options.agent);
  report.other = static_cast<std::uint16_t>(options.other);
  report.range_m = static_cast<float>(options.range_m);
  report.sigma_m = static_cast<float>(options.sigma_m);
  report.stamp = Stamp{static_cast<Stamp::rep>(options.stamp_s * 1e9)};
  if (!options.bearing.empty()) {
    for (std::size_t i = 0; i < 3; ++i) report.bearing[i] = static_cast<float>(options.bearing[i]);
    report.bearing_sigma_rad = static_cast<float>(options.bearing_sigma_rad);
  }
  if (!valid(report)) {
    throw Failure{"range: two different agents, 0..10000 m, sigma 0..60 m, a bearing of length 1",
                  2};
  }
  auto opened = RangeWriter::open(options.dds);
  if (!opened) throw Failure{opened.error().what};
  RangeWriter& writer = **opened;
  if (!writer.wait_for_reader(seconds{5}) || !writer.write(report, seconds{5})) {
    throw Failure{"nobody reads ranges in DDS domain " + std::to_string(options.dds.domain) +
                  ": is mapletd running with that dds.domain?"};
  }
}

}  // namespace

void add_range(Command app) {
  auto options = std::make_shared<Options>();
  const Command command = app.add_command(
      "range", "Tells a running daemon how far another agent is: topic maplet/range, one message");
  command.add_option("OTHER", options->other, "the other agent's number")
      .required()
      .range(0, 65535);
  command.add_option("RANGE_M", options->range_m, "distance, m").required();
  command.add_option("--agent", options->agent, "whose sensor it was: the daemon's --agent")
      .range(0, 65535)
      .show_default();
  command.add_option("--sigma", options->sigma_m, "standard deviation, m").show_default();
  command.add_option("--stamp-s", options->stamp_s, "by the frames' clock; 0: now").show_default();
  command.add_option("--bearing", options->bearing, "x,y,z: unit vector, camera's frame")
      .comma_list(3);
  command.add_option("--angle-sigma", options->bearing_sigma_rad, "rad").show_default();
  command.add_option("--domain", options->dds.domain, "DDS domain (the daemon's dds.domain)")
      .range(0, 230)
      .show_default();
  command.run([options] { run(*options); });
}

}  // namespace maplet::ctl
