// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The flight recorder: what it holds is saved; two runs are compared.
#include <fmt/core.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <vector>

#include "tools/mapletctl/ask.hpp"

namespace maplet::ctl {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct Save {
  Daemon daemon;
  std::string out;
  bool json = false;
};

void save(const Save& options) {
  const fs::path out = fs::absolute(options.out);
  const Json answer = ask(options.daemon, {{"command", "recorder"}, {"out", out.string()}});
  if (options.json) {
    fmt::print("{}\n", answer.dump());
    return;
  }
  fmt::print("{}: mapletd --source record:{} --out DIR replays it\n", out.string(), out.string());
  if (!answer["whole"].get<bool>())
    fmt::print("its end is missing: the recorder's disk was too slow\n");
}

std::string content_of(const fs::path& file) {
  std::ifstream in{file, std::ios::binary};
  return {std::istreambuf_iterator<char>{in}, {}};
}

/// What two runs differ in first.
struct First {
  std::uint64_t frame = ~std::uint64_t{0};  ///< of the source
  std::size_t stage = ~std::size_t{0};      ///< in the order of the data path
  std::string file;
  std::string entry{};  ///< of the report

  [[nodiscard]] bool before(const First& other) const {
    return std::pair{frame, stage} < std::pair{other.frame, other.stage};
  }
};

constexpr const char* kStages[] = {"patches",      "odometry", "maplet",
                                   "registration", "skeleton", "report"};
constexpr std::size_t kColumns = 5;  // of frames.digest: stages with a mark for each frame

std::vector<std::string> lines_of(const fs::path& file) {
  std::istringstream in{content_of(file)};
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

/// frames.digest: a line a frame, its number and a mark for each stage's result.
void compare_frames(const fs::path& a, const fs::path& b, First& first) {
  const auto lines_a = lines_of(a / "frames.digest");
  const auto lines_b = lines_of(b / "frames.digest");
  for (std::size_t i = 0; i < std::max(lines_a.size(), lines_b.size()); ++i) {
    if (i < lines_a.size() && i < lines_b.size() && lines_a[i] == lines_b[i]) continue;
    std::istringstream in_a{i < lines_a.size() ? lines_a[i] : ""};
    std::istringstream in_b{i < lines_b.size() ? lines_b[i] : ""};
    std::uint64_t frame_a = i;
    std::uint64_t frame_b = i;
    in_a >> frame_a;
    in_b >> frame_b;
    First found{std::min(frame_a, frame_b), 0, "frames.digest"};
    for (std::size_t stage = 0; frame_a == frame_b && stage < kColumns; ++stage) {
      std::string mark_a;
      std::string mark_b;
      in_a >> mark_a;
      in_b >> mark_b;
      found.stage = stage;
      if (mark_a != mark_b) break;
    }
    if (found.before(first)) first = found;
    return;
  }
}

/// The first entry of the report that differs, as a path: /frames/read.
std::string first_entry(const Json& a, const Json& b) {
  const auto changes = nlohmann::json::diff(a, b);
  return changes.empty() ? "" : changes[0]["path"].get<std::string>();
}

/// The report, but for times and memory.
Json figures(const fs::path& folder) {
  Json report = Json::parse(content_of(folder / "report.json"), nullptr, false);
  if (!report.is_object()) return {};
  for (const char* key : {"stages", "memory", "exchange"}) report.erase(key);
  return report;
}

void compare_files(const fs::path& a, const fs::path& b, First& first) {
  struct Kind {
    const char* file;
    std::size_t stage;
  };
  for (const Kind& kind :
       {Kind{"odometry.tum", 1}, Kind{"delta_poses.jsonl", 3}, Kind{"skeleton.g2o", 4},
        Kind{"trajectory.tum", 4}, Kind{"skeleton_alone.g2o", 4}, Kind{"map.ply", 4}}) {
    if (content_of(a / kind.file) == content_of(b / kind.file)) continue;
    First found{~std::uint64_t{0} - 1, kind.stage, kind.file};
    if (found.before(first)) first = found;
  }
  for (const auto& [x, y] : {std::pair{a, b}, std::pair{b, a}}) {
    std::error_code none;
    for (const auto& entry : fs::directory_iterator{x / "maplets", none}) {
      const fs::path name = fs::path{"maplets"} / entry.path().filename();
      if (content_of(x / name) == content_of(y / name)) continue;
      First found{~std::uint64_t{0} - 1, 2, name.string()};
      if (found.before(first)) first = found;
    }
  }
  if (const Json of_a = figures(a), of_b = figures(b); of_a != of_b) {
    First found{~std::uint64_t{0} - 1, 5, "report.json", first_entry(of_a, of_b)};
    if (found.before(first)) first = found;
  }
}

struct Diff {
  std::string a;
  std::string b;
  bool json = false;
};

int diff(const Diff& options) {
  for (const std::string& folder : {options.a, options.b}) {
    if (!fs::exists(fs::path{folder} / "report.json"))
      throw Failure{folder + ": is no folder of mapletd --out: it has no report.json", 2};
  }
  First first;
  compare_frames(options.a, options.b, first);
  compare_files(options.a, options.b, first);
  const bool equal = first.file.empty();
  Json json{{"equal", equal}, {"first", Json{}}};
  const bool known = !equal && first.frame < ~std::uint64_t{0} - 1;
  if (!equal) {
    json["first"] = {{"frame", known ? Json(first.frame) : Json{}},
                     {"stage", kStages[first.stage]},
                     {"file", first.file}};
    if (!first.entry.empty()) json["first"]["entry"] = first.entry;
  }
  if (options.json) {
    fmt::print("{}\n", json.dump());
  } else if (equal) {
    fmt::print("equal\n");
  } else if (known) {
    fmt::print("first different: frame {}, {} ({})\n", first.frame, kStages[first.stage],
               first.file);
  } else {
    fmt::print("first different: {} ({}{})\n", kStages[first.stage], first.file, first.entry);
  }
  return equal ? 0 : 1;
}

}  // namespace

void add_recorder(Command app) {
  const Command recorder = app.add_command("recorder", "The flight recorder of a running mapletd");
  auto options = std::make_shared<Save>();
  const Command sub = recorder.add_command(
      "save", "Copies what it holds: mapletd --source record:FILE replays that bit for bit");
  sub.add_option("--out", options->out, "file to write").required().type_name("FILE");
  add_daemon_options(sub, std::shared_ptr<Daemon>{options, &options->daemon});
  sub.add_flag("--json", options->json, "the answer, as JSON");
  sub.run([options] { save(*options); });
}

void add_diff(Command app) {
  auto options = std::make_shared<Diff>();
  const Command command = app.add_command(
      "diff", "Compares two --out folders, times apart: the first frame and stage that differ");
  command.add_option("A", options->a, "folder of mapletd --out").required().type_name("RUN");
  command.add_option("B", options->b, "another").required().type_name("RUN");
  command.add_flag("--json", options->json, "{equal, first: {frame, stage, file}}");
  command.run([options] {
    if (diff(*options) != 0) throw Failure{"the runs differ"};
  });
}

}  // namespace maplet::ctl
