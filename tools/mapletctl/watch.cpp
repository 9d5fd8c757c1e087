// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <memory>
#include <numbers>

#include "tools/mapletctl/command.hpp"
#include "transport/dds/subscriber.hpp"
#include "transport/exchange/json.hpp"

namespace maplet::ctl {
namespace {

struct Options {
  DdsConfig dds;
  std::vector<std::string> kinds = {"delta-pose", "maplet", "status"};
  std::uint64_t count = 0;
  double timeout_s = 0.0;
  bool json = false;
};

volatile std::sig_atomic_t stop_asked = 0;

/// Leaving the domain properly tells the others at once: a killed watcher stays in their books for
/// seconds. A closed pipe (`| head -1`) is a failed write, not the end of the process.
void catch_signals() {
  struct sigaction stop {};
  stop.sa_handler = [](int) { stop_asked = 1; };
  sigaction(SIGINT, &stop, nullptr);
  sigaction(SIGTERM, &stop, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
}

std::string name(const MapletKey& key) { return fmt::format("{}:{:04}", key.agent, key.id); }

std::string sentence(const DeltaPoseRecord& record) {
  constexpr double kDegrees = 180.0 / std::numbers::pi;
  const DeltaPose delta = restore(record);
  const auto& sigma = record.covariance.sigma;
  return fmt::format(
      "delta-pose  {} {} {}  {:6.3f} m {:6.2f} deg  sigma {:.1f} {:.1f} {:.1f} mm  {:.2f} {:.2f} "
      "{:.2f} deg  overlap {:.2f}  matches {}",
      name(delta.a), delta.kind == DeltaPose::Kind::kClosure ? "<closure>" : "->", name(delta.b),
      delta.T_a_b.se3.t.norm(), delta.T_a_b.se3.angle() * kDegrees, sigma[0] * 1e3, sigma[1] * 1e3,
      sigma[2] * 1e3, sigma[3] * kDegrees, sigma[4] * kDegrees, sigma[5] * kDegrees, delta.overlap,
      delta.matches);
}

std::string sentence(const MapletRecord& record) {
  return fmt::format("maplet      {}  {} bytes  {} planes  {} keyframes", name(record.key),
                     record.bytes.size(), record.planes, record.keyframes);
}

std::string sentence(const StatusRecord& record) {
  return fmt::format(
      "status      {}  {}  {} frames ({} dropped, {} lost)  {} maplets  {} delta-poses  skeleton "
      "{} nodes {} factors  frame p99 {:.1f} ms  {:.1f} MB",
      record.agent, to_string(record.state), record.frames_processed, record.frames_dropped,
      record.frames_lost, record.maplets, record.delta_poses, record.nodes, record.factors,
      record.stages.back().p99_us / 1e3, static_cast<double>(record.rss_bytes) / 1e6);
}

/// @return false when nobody reads any more
bool print(const DdsSubscriber::Message& message, bool json) {
  std::visit(
      [json](const auto& record) {
        if (json) {
          const JsonLine line = to_json(record);
          fmt::print("{}\n", fmt::string_view{line.data(), line.size()});
        } else {
          fmt::print("{}\n", sentence(record));
        }
      },
      message);
  return std::fflush(stdout) == 0;
}

DdsSubscriber::Wanted wanted(const std::vector<std::string>& kinds) {
  DdsSubscriber::Wanted wanted{false, false, false};
  for (const auto& kind : kinds) {
    wanted.delta_poses = wanted.delta_poses || kind == "delta-pose";
    wanted.maplets = wanted.maplets || kind == "maplet";
    wanted.statuses = wanted.statuses || kind == "status";
  }
  return wanted;
}

void run(const Options& options) {
  using std::chrono::milliseconds;
  catch_signals();
  auto opened = DdsSubscriber::open(options.dds, wanted(options.kinds));
  if (!opened) throw Failure{opened.error().what};
  const std::unique_ptr<DdsSubscriber> subscriber = std::move(*opened);
  if (isatty(STDERR_FILENO) != 0) {
    fmt::print(stderr, "waiting for messages in DDS domain {} on {}, Ctrl-C ends\n",
               options.dds.domain, options.dds.interface);
  }
  const MonotonicClock clock;
  const Instant start = clock.now();
  std::uint64_t count = 0;
  while (stop_asked == 0 && (options.count == 0 || count < options.count)) {
    const auto message = subscriber->next(milliseconds{100});
    if (message) {
      ++count;
      if (!print(*message, options.json)) return;
    } else if (message.error().code != ErrorCode::kTimeout) {
      throw Failure{message.error().what};
    }
    if (options.timeout_s > 0.0 && seconds(clock.now() - start) >= options.timeout_s) break;
  }
  if (subscriber->rejected() > 0) {
    fmt::print(stderr, "mapletctl: {} messages made no sense and were skipped\n",
               subscriber->rejected());
  }
  if (stop_asked == 0 && count < options.count) {
    throw Failure{fmt::format(
        "{} of {} messages came within {} s: is mapletd running with "
        "dds.domain {} on {}?",
        count, options.count, options.timeout_s, options.dds.domain, options.dds.interface)};
  }
}

}  // namespace

void add_watch(Command app) {
  auto options = std::make_shared<Options>();
  const Command command = app.add_command(
      "watch", "Prints what the local DDS domain carries, a line per message, until Ctrl-C");
  command.add_option("--domain", options->dds.domain, "DDS domain (the daemon's dds.domain)")
      .range(0, 230)
      .show_default();
  command.add_option("--interface", options->dds.interface, "network interface").show_default();
  command.add_option("--peer", options->dds.peers, "address of another host to look at");
  command.add_option("--kind", options->kinds, "what to print")
      .comma_list()
      .one_of({"delta-pose", "maplet", "status"})
      .show_default();
  command.add_option("--count", options->count, "ends after so many messages");
  command.add_option("--timeout-s", options->timeout_s, "ends after so many seconds").positive();
  command.add_flag("--json", options->json,
                   "JSON lines; delta-poses exactly as in delta_poses.jsonl");
  command.run([options] { run(*options); });
}

}  // namespace maplet::ctl
