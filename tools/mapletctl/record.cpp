// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "daemon/configure.hpp"
#include "daemon/progress.hpp"
#include "daemon/run_setup.hpp"
#include "daemon/signals.hpp"
#include "drivers/open_source.hpp"
#include "drivers/openni2/openni2_source.hpp"
#include "drivers/replay/tum_writer.hpp"
#include "tools/mapletctl/command.hpp"

namespace maplet::ctl {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::uint64_t kMb = 1'000'000;
constexpr std::uint64_t kSpareBytes = 100 * kMb;  ///< that the disk keeps
constexpr std::uint64_t kBehindFrames = 64;  ///< at most that OpenNI2's recorder has not written
constexpr std::uint64_t kIndexBytes = 100'000;

struct Options {
  daemon::Options daemon;
  std::string out;
  std::uint64_t frames = 0;
  double seconds = 0.0;
  std::uint64_t max_mb = 4000;
  bool json = false;
};

/// Why it ends, and what it has.
struct Recording {
  std::string ended;
  std::uint64_t frames = 0;
  std::uint64_t bytes = 0;
  std::uint64_t raw_bytes = 0;  ///< of a frame as the camera sends it
};

bool is_oni(const std::string& out) { return out.ends_with(".oni"); }

std::unique_ptr<DepthSource> open(const Options& options) {
  auto config = daemon::configure(options.daemon);
  if (!config) throw Failure{config.error(), 2};
  std::string uri = config->input.source;
  if (uri.empty()) throw Failure{"no source: give --source, or input.source in the file", 2};
  const SourceOptions wanted = daemon::source_options(*config);
  if (is_oni(options.out) && !uri.starts_with("openni2:")) {
    throw Failure{uri + ": only OpenNI2's cameras go into .oni files; name a folder as --out", 2};
  }
  if (is_oni(options.out) && fs::exists(options.out)) {
    throw Failure{options.out + ": is there already; remove it, or name another file"};
  }
  auto source = is_oni(options.out) ? record_openni2(uri.substr(8), options.out, wanted)
                                    : open_source(uri, wanted);
  if (!source) {
    throw Failure{source.error().what, source.error().kind == SourceError::Kind::kUsage ? 2 : 1};
  }
  return std::move(*source);
}

/// A frame; nothing when the recording ends for a reason of the source's.
std::optional<DepthFrame> next(DepthSource& source, Recording& recording) {
  constexpr int kPatience = 5;  // of a second each
  const MonotonicClock clock;
  for (int i = 0; i < kPatience && !daemon::stop_asked(); ++i) {
    auto frame = source.next(Deadline{clock, std::chrono::seconds{1}});
    if (frame) return *frame;
    if (frame.error().code == ErrorCode::kTimeout) continue;
    recording.ended =
        frame.error().code == ErrorCode::kEnd ? "the source is over" : std::string{source.detail()};
    return {};
  }
  recording.ended = daemon::stop_asked() ? "stopped" : "no frame for 5 s";
  return {};
}

RecordedCamera camera_of(const DepthFrame& frame) {
  RecordedCamera camera;
  camera.camera = frame.camera;
  camera.metres_per_unit = frame.metres_per_unit;
  camera.registered_to_colour = !frame.gray.empty();
  return camera;
}

std::uint64_t raw_bytes_of(const DepthFrame& frame) {
  const auto pixels = static_cast<std::uint64_t>(frame.depth.width_px) *
                      static_cast<std::uint64_t>(frame.depth.height_px);
  return pixels * (frame.gray.empty() ? 2 : 2 + 3);  // depth, RGB
}

/// Whether one more frame fits: into what was asked for, and onto the disk.
std::string full(const Options& options, const Recording& recording, double since_s) {
  const std::uint64_t budget = options.max_mb * kMb;
  if (options.frames > 0 && recording.frames >= options.frames) return "as many frames as asked";
  if (options.seconds > 0.0 && since_s >= options.seconds) return "as long as asked";
  // OpenNI2 writes behind, on a thread of its own: what is not in the file yet may be as large as
  // it came. Never more than all of them.
  const std::uint64_t behind = std::min<std::uint64_t>(recording.frames + 2, kBehindFrames);
  const std::uint64_t most =
      is_oni(options.out) ? std::min(recording.bytes + behind * recording.raw_bytes + kIndexBytes,
                                     (recording.frames + 2) * recording.raw_bytes + kIndexBytes)
                          : recording.bytes + 2 * recording.raw_bytes;
  if (most > budget) return fmt::format("the budget of {} MB", options.max_mb);
  std::error_code error;
  const fs::path folder = fs::absolute(options.out, error).parent_path();
  const auto space = fs::space(folder, error);
  if (!error && space.available < kSpareBytes + most - recording.bytes)
    return "the disk is nearly full";
  return {};
}

Recording record(const Options& options, DepthSource& source) {
  std::optional<TumWriter> writer;
  Recording recording;
  const auto total = options.frames > 0 ? std::optional{options.frames} : source.length();
  daemon::catch_signals(false);
  Progress progress{options.out, total};
  const auto began = std::chrono::steady_clock::now();
  while (true) {
    const auto frame = next(source, recording);
    if (!frame) break;
    if (!is_oni(options.out)) {
      if (!writer) {
        auto made = TumWriter::create(options.out, camera_of(*frame), "record");
        if (!made) throw Failure{made.error()};
        writer = std::move(*made);
      }
      if (auto done = writer->write(*frame); !done) throw Failure{done.error()};
    }
    ++recording.frames;
    recording.raw_bytes = raw_bytes_of(*frame);
    std::error_code error;
    recording.bytes = writer ? writer->bytes() : fs::file_size(options.out, error);
    progress.show(recording.frames);
    const std::chrono::duration<double> since = std::chrono::steady_clock::now() - began;
    recording.ended = full(options, recording, since.count());
    if (!recording.ended.empty()) break;
  }
  if (writer) {
    if (auto done = writer->finish(); !done) throw Failure{done.error()};
  }
  return recording;
}

void run(const Options& options) {
  if (options.out.empty()) throw Failure{"--out is empty: name FILE.oni or a folder", 2};
  auto source = open(options);
  Recording recording = record(options, *source);
  const SourceCounters counters = source->counters();
  source.reset();  // OpenNI2 closes the file
  std::error_code error;
  if (is_oni(options.out)) recording.bytes = fs::file_size(options.out, error);
  if (recording.frames == 0) {
    throw Failure{fmt::format("{}: nothing was recorded: {}", options.out, recording.ended)};
  }
  if (options.json) {
    fmt::print("{}\n", Json({{"out", options.out},
                             {"frames", recording.frames},
                             {"dropped", counters.dropped},
                             {"bytes", recording.bytes},
                             {"ended", recording.ended}})
                           .dump());
    return;
  }
  fmt::print("{}: {} frames, {:.1f} MB ({}); {} came too fast{}\n", options.out, recording.frames,
             static_cast<double>(recording.bytes) / 1e6, recording.ended, counters.dropped,
             is_oni(options.out) && counters.dropped > 0 ? ", the file has them" : "");
}

}  // namespace

void add_record(Command app) {
  auto options = std::make_shared<Options>();
  const Command command = app.add_command(
      "record",
      "Records a camera: into an .oni file by OpenNI2's recorder, or any source into a folder in "
      "TUM layout");
  command.footer(
      "Ends with SIGINT (Ctrl-C), and before the disk is full. A recording with colour is used "
      "with\n--set camera.registered_to_colour=true (.oni); a folder says so itself.");
  command.add_option("--source", options->daemon.source, "source URI, as mapletd takes it");
  command.add_option("--out", options->out, "FILE.oni, or a folder").required();
  command.add_option("--frames", options->frames, "so many frames at most; 0 = no limit");
  command.add_option("--seconds", options->seconds, "so long at most; 0 = no limit").non_negative();
  command.add_option("--max-mb", options->max_mb, "so many MB at most").show_default();
  command.add_option("--config", options->daemon.config_file, "TOML file, as mapletd takes it");
  command.add_option("--set", options->daemon.overrides, "key=value over the file").one_each();
  command.add_flag("--json", options->json, "One line of JSON");
  command.run([options] { run(*options); });
}

}  // namespace maplet::ctl
