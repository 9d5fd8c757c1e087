// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The mission on disk: list, export, import, clear. Of a running daemon, or of a folder.
#include "tools/files/mission.hpp"

#include <fmt/core.h>

#include <chrono>
#include <filesystem>

#include "daemon/clear_mission.hpp"
#include "daemon/state_directory.hpp"
#include "tools/files/ply.hpp"
#include "tools/files/run_folder.hpp"
#include "tools/mapletctl/ask.hpp"

namespace maplet::ctl {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct Options {
  Daemon daemon;
  std::string state;
  std::string path;
  bool json = false;
};

Json streams_json(const std::array<std::uint32_t, kStreams>& counts) {
  Json json;
  for (std::size_t i = 0; i < kStreams; ++i)
    json[std::string{to_string(static_cast<Stream>(i))}] = counts[i];
  return json;
}

/// The folder to look into: --state's, or the running daemon's.
std::string folder_of(const Options& options, Json& answer) {
  if (!options.state.empty()) return options.state;
  answer = ask(options.daemon, {{"command", "mission"}});
  std::string folder = answer.value("directory", std::string{});
  if (folder.empty())
    throw Failure{"that mapletd runs without a journal: start it with --state DIR"};
  return folder;
}

Json list_json(const files::Mission& m) {
  Json json{{"agent", m.life().agent},
            {"epoch", m.life().epoch},
            {"flushed", streams_json(m.survey.ends)},
            {"maplets", m.own[static_cast<std::size_t>(Stream::kMaplets)]},
            {"records", streams_json(m.own)},
            {"missing", streams_json(m.missing)},
            {"heard", m.delta_poses.size() + m.ranges.size() - m.own[0] - m.own[1] - m.own[2]},
            {"decisions", m.decisions.size()},
            {"snapshot_nodes", m.snapshot_nodes},
            {"parts", Json::array()},
            {"file", m.file},
            {"version", m.survey.version},
            {"generation", m.survey.generation},
            {"bytes", m.survey.end - static_cast<std::uint64_t>(m.survey.half) *
                                         m.survey.half_pages * journal::kPageBytes},
            {"half_bytes", std::uint64_t{m.survey.half_pages} * journal::kPageBytes},
            {"damage", daemon::describe(m.survey.damage)}};
  for (const journal::Part& part : m.parts) {
    json["parts"].push_back({{"first_maplet", part.first_maplet}, {"started_s", part.started_s}});
  }
  return json;
}

void list(const Options& options) {
  Json answer;
  const std::string folder = folder_of(options, answer);
  const files::Mission mission = files::read_mission(folder);
  Json json = list_json(mission);
  json["clear_at_start"] = daemon::clear_is_asked(folder);
  if (!answer.is_null()) json["flushed"] = answer["flushed"];
  if (options.json) {
    fmt::print("{}\n", json.dump());
    return;
  }
  fmt::print("agent {} epoch {}: {} maplets, {} delta-poses, {} closures, {} records of others\n",
             mission.life().agent, mission.life().epoch, json["maplets"].get<std::int64_t>(),
             json["records"]["delta_poses"].get<std::int64_t>(),
             json["records"]["closures"].get<std::int64_t>(), json["heard"].get<std::int64_t>());
  for (const journal::Part& part : mission.parts) {
    const auto at = static_cast<std::time_t>(part.started_s);
    char text[32] = "";
    std::strftime(text, sizeof text, "%Y-%m-%d %H:%M:%S", std::gmtime(&at));
    fmt::print("  started {} UTC at maplet {}\n", text, part.first_maplet);
  }
  const std::string damage = json["damage"];
  if (!damage.empty()) fmt::print("  damage: {}\n", damage);
  if (json["clear_at_start"].get<bool>())
    fmt::print("  mission clear was asked for: the next start removes all this\n");
}

void export_to(const Options& options) {
  Json answer;
  const files::Mission mission = files::read_mission(folder_of(options, answer));
  files::export_mission(mission, options.path);
  files::PlyMesh mesh;
  if (!mission.maplets.empty()) {
    for (const files::RunMaplet& m : files::read_run(options.path).maplets) {
      for (const files::Surface& surface : m.surfaces)
        mesh.add(files::moved(m.T_world_maplet.se3, surface), files::colour_of(m.id, surface));
    }
  }
  mesh.write(fs::path{options.path} / "map.ply");
  if (options.json) fmt::print("{}\n", list_json(mission).dump());
}

/// A file appears whole or not at all.
void place(const fs::path& from, const fs::path& to) {
  std::error_code error;
  const fs::path part = to.string() + ".part";
  fs::copy_file(from, part, fs::copy_options::overwrite_existing, error);
  if (!error) fs::rename(part, to, error);
  if (error) throw Failure{fmt::format("{}: {}", to.string(), error.message())};
  (void)journal::flush_folder(to.parent_path().string());
}

void import_from(const Options& options) {
  Json answer;
  const std::string folder = folder_of(options, answer);
  if (daemon::clear_is_asked(folder)) {
    throw Failure{folder +
                  ": a clear waits for mapletd's next start there, which would remove this, too; "
                  "start mapletd once, then import"};
  }
  const files::Mission mission = files::read_mission(options.path);
  journal::PosixFile own;
  if (const auto there =
          daemon::open_mission((fs::path{folder} / daemon::kMissionFile).string(), own);
      there && there->life == mission.life()) {
    throw Failure{options.path + ": is the mission that " + folder +
                  " goes on with, or a copy of it"};
  }
  std::error_code error;
  fs::create_directories(folder, error);
  place(mission.file, fs::path{folder} / fmt::format("{}-{:08x}.imported", mission.life().agent,
                                                     mission.life().epoch));
  if (options.json) {
    fmt::print("{}\n", list_json(mission).dump());
  } else {
    fmt::print("{} maplets of agent {}: mapletd shows them beside its own from its next start\n",
               mission.maplets.size(), mission.life().agent);
  }
}

void clear(const Options& options) {
  Json answer;
  const std::string folder = folder_of(options, answer);
  if (!fs::is_directory(folder)) throw Failure{folder + ": no such folder"};
  const auto cleared = daemon::clear_mission(folder);
  if (!cleared) throw Failure{cleared.error()};
  const bool now = *cleared == daemon::Cleared::kNow;
  if (options.json) {
    fmt::print("{}\n", Json{{"cleared", now ? "now" : "at_next_start"}}.dump());
  } else {
    fmt::print("{}\n", now ? "cleared"
                           : "mapletd works with it: the mission ends with this run, and the next "
                             "start begins a new one");
  }
}

void add(Command mission, const char* name, const char* help, const char* path,
         const char* path_help, void (*run)(const Options&)) {
  auto options = std::make_shared<Options>();
  const Command sub = mission.add_command(name, help);
  if (path != nullptr) sub.add_option(path, options->path, path_help).required();
  sub.add_option("--state", options->state, "the folder of mapletd --state, without a daemon")
      .type_name("DIR");
  add_daemon_options(sub, std::shared_ptr<Daemon>{options, &options->daemon});
  sub.add_flag("--json", options->json, "the answer, as JSON");
  sub.run([options, run] { run(*options); });
}

}  // namespace

void add_mission(Command app) {
  const Command mission = app.add_command(
      "mission", "What mapletd --state keeps of its mission: what is safe, and for other programs");
  add(mission, "list", "Who, how many records and maplets, the starts, what is damaged", nullptr,
      nullptr, list);
  add(mission, "export",
      "Writes trajectory.tum, skeleton.g2o, map.ply, maplets/ and the mission itself", "DIR",
      "folder to write", export_to);
  add(mission, "import",
      "Takes another mission in, from its next start on, as another agent's: nothing of the own "
      "one "
      "changes",
      "PATH", "a mission.journal, or a folder of mission export or --state", import_from);
  add(mission, "clear", "Removes the mission, and what was imported", nullptr, nullptr, clear);
}

}  // namespace maplet::ctl
