// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/flight_setup.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <nlohmann/json.hpp>
#include <utility>

#include "daemon/log.hpp"
#include "drivers/open_source.hpp"
#include "drivers/uri.hpp"

namespace maplet::daemon {

namespace {

using Json = nlohmann::json;

std::string path_of(const std::string& source) {
  const auto uri = Uri::parse(source);
  return uri ? uri->path : std::string{};
}

tl::expected<Json, std::string> head_of(const flight::RingReader& file, const std::string& path) {
  Json head = Json::parse(file.head(), nullptr, false);
  const bool good = head.is_object() && head.value("config", Json{}).is_string() &&
                    head.value("agent", Json{}).is_number_unsigned() &&
                    head.value("epoch", Json{}).is_number_unsigned() &&
                    head.value("pace", Json{}).is_number_unsigned() &&
                    head.value("version", Json{}).is_string();
  if (!good) return tl::unexpected{path + ": is no flight recorder's file"};
  if (head["version"] != MAPLET_VERSION) {
    return tl::unexpected{
        fmt::format("{}: was recorded by mapletd {}, and this is {}: replay it "
                    "with that one",
                    path, head["version"].get<std::string>(), MAPLET_VERSION)};
  }
  return head;
}

}  // namespace

bool is_record(std::string_view source) noexcept { return source.starts_with("record:"); }

tl::expected<Config, ConfigError> recorded_config(const std::string& source) {
  const std::string path = path_of(source);
  const auto file = flight::RingReader::open(path);
  if (!file) return tl::unexpected{file.error()};
  const auto head = head_of(**file, path);
  if (!head) return tl::unexpected{head.error()};
  return parse_config((*head)["config"].get<std::string>(), path);
}

std::string flight_problem(const std::string& source) {
  if (!check_source(source)) return {};  // configure() says it
  const std::string path = path_of(source);
  if (access(path.c_str(), R_OK) != 0) {
    return fmt::format(
        "{}: {}: name a file of the flight recorder (recorder.file, or mapletctl recorder save)",
        path, std::strerror(errno));
  }
  const auto config = recorded_config(source);
  return config ? "" : config.error();
}

std::vector<std::string> without_effect(const Options& options, const Config& config,
                                        const Flight& flight) {
  std::vector<std::string> lines;
  const auto add = [&](const std::string& what) { lines.push_back("a replay " + what); };
  if (options.agent_given && options.agent != flight.identity.agent) {
    add(fmt::format("is of what ran: agent {}; --agent {} has no effect", flight.identity.agent,
                    options.agent));
  }
  if (options.state_given) add("keeps no mission: --state has no effect");
  if (options.pace == Options::Pace::kRecorded)
    add("goes as fast as it can, with the times that were recorded: --pace has no effect");
  if (!config.recorder.file.empty()) add("records nothing: recorder.file has no effect");
  if (!options.config_file.empty()) {
    lines.push_back(options.config_file +
                    " replaces what ran with: without --config it is replayed bit for bit");
  }
  return lines;
}

tl::expected<std::optional<Flight>, std::string> open_flight(const Config& config) {
  if (!is_record(config.input.source)) return std::optional<Flight>{};
  const std::string path = path_of(config.input.source);
  auto file = flight::RingReader::open(path);
  if (!file) return tl::unexpected{file.error()};
  const auto head = head_of(**file, path);
  if (!head) return tl::unexpected{head.error()};
  if (!(*file)->complete()) {
    log_warning(path +
                ": its beginning was overwritten: what is left is replayed from an empty "
                "map, which is not what ran");
  }
  Flight flight;
  flight.identity = {(*head)["agent"].get<std::uint16_t>(), (*head)["epoch"].get<std::uint32_t>()};
  if (const auto ran = parse_config((*head)["config"].get<std::string>(), path))
    flight.source = ran->input.source;
  flight.pace = static_cast<Pace>(std::min((*head)["pace"].get<unsigned>(), 2U));
  flight.radio = head->value("radio", false);
  flight.finite = head->value("finite", false);
  flight.resumed = head->value("resumed", false);
  flight.file = std::move(*file);
  return std::optional<Flight>{std::move(flight)};
}

tl::expected<std::unique_ptr<FlightWriter>, std::string> start_recording(const Config& config,
                                                                         AgentIdentity identity,
                                                                         Pace pace, bool radio,
                                                                         bool finite,
                                                                         bool resumed) {
  const RecorderConfig& recorder = config.recorder;
  auto ring =
      flight::RingWriter::make(recorder.file, static_cast<std::uint64_t>(recorder.size_mib) << 20);
  if (!ring) return tl::unexpected{ring.error()};
  Config content = config;
  content.recorder = {};  // a replay records nothing
  const std::string head = Json{
      {"version", MAPLET_VERSION},
      {"agent", identity.agent},
      {"epoch", identity.epoch},
      {"pace", static_cast<unsigned>(pace)},
      {"radio", radio},
      {"finite", finite},
      {"resumed", resumed},
      {"config",
       print_config(content)}}.dump();
  if (!(*ring)->put(flight::Block::kHead, std::as_bytes(std::span{head})))
    return tl::unexpected{recorder.file + ": cannot be written"};
  return std::make_unique<FlightWriter>(std::move(*ring), recorder.file,
                                        static_cast<std::size_t>(recorder.queue_kib) * 1024);
}

}  // namespace maplet::daemon
