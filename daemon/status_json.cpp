// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/status_json.hpp"

#include <fmt/format.h>

#include <cstring>
#include <filesystem>
#include <string>

#include "core/ports/stage_meter.hpp"
#include "daemon/alloc_counter.hpp"
#include "daemon/histogram_json.hpp"
#include "daemon/tracking_json.hpp"
#include "transport/exchange/record_key.hpp"

namespace maplet::daemon {

namespace {

using Json = nlohmann::ordered_json;

std::string hex(std::uint64_t value) { return fmt::format("{:016x}", value); }

Json streams_json(const std::array<std::uint32_t, kStreams>& counts) {
  Json json;
  for (std::size_t i = 0; i < kStreams; ++i) {
    json[std::string{to_string(static_cast<Stream>(i))}] = counts[i];
  }
  return json;
}

Json exchange_json(const RadioStatus& radio) {
  const NodeCounters& n = radio.counters;
  return {{"open", radio.open},
          {"silent", radio.silent},
          {"in_sync", radio.settled},
          {"listeners", radio.listeners},
          {"records", radio.records},
          {"records_digest", hex(radio.records_digest)},
          {"own", streams_json(radio.own)},
          {"missing", radio.missing},
          {"wire_bytes", radio.wire_bytes},
          {"dds_bytes", radio.dds_bytes},
          {"held_back", radio.held_back},
          {"bytes_last_10_s", radio.window_bytes},
          {"delta_pose_bytes", radio.lane_bytes[0]},
          {"closure_bytes", radio.lane_bytes[1]},
          {"range_bytes", radio.lane_bytes[2]},
          {"control_bytes", radio.lane_bytes[3]},
          {"maplet_bytes", radio.lane_bytes[4]},
          {"conflicts", radio.conflicts},
          {"conflicting_agent", radio.conflicting_agent},
          {"datagrams",
           {{"in", n.datagrams_in},
            {"out", n.datagrams_out},
            {"damaged", n.damaged},
            {"future", n.future},
            {"malformed", n.malformed}}},
          {"received", n.received},
          {"duplicates", n.duplicates},
          {"conflicting", n.conflicting},
          {"forged_own", n.forged_own},
          {"refused", n.refused},
          {"lives_refused", radio.lives_refused},
          {"maplets",
           {{"kept", radio.maplets.kept},
            {"received", radio.maplets.received},
            {"damaged", radio.maplets.damaged},
            {"given_up", radio.maplets.given_up},
            {"bytes_sent", radio.maplets.bytes_sent}}}};
}

Json fill_json(const Fill& fill) {
  return {{"used", fill.used}, {"peak", fill.peak}, {"capacity", fill.capacity}};
}

/// Bytes of each component of the arena: what stands before the slash of its entries. They are
/// taken at the start, so used and peak are one; what fills is told beside them.
Json memory_json(const MemoryStatus& memory, const Fills& fills) {
  Json pools = Json::object();
  for (const ArenaEntry& entry : memory.arena().ledger()) {
    const std::string pool{entry.component.substr(0, entry.component.find('/'))};
    pools[pool] = pools.value(pool, std::size_t{0}) + entry.bytes;
  }
  Json json{{"arena_bytes", memory.arena().used_bytes()},
            {"pools", pools},
            {"fill",
             {{"own_maplets", fill_json(fills.own_maplets)},
              {"nodes", fill_json(fills.nodes)},
              {"factors", fill_json(fills.factors)}}},
            {"rss_bytes", rss_bytes()},
            {"peak_rss_bytes", peak_rss_bytes()}};
  json["limit_bytes"] = memory.limit_bytes() ? Json(*memory.limit_bytes()) : Json{};
  json["locked"] = memory.locked();
  const bool counted = allocation_counting_available();  // not under a sanitizer
  json["heap_allocations_after_ready"] = counted ? Json(allocation_counts().ours) : Json{};
  json["third_party_allocations"] = counted ? Json(allocation_counts().third_party) : Json{};
  return json;
}

/// What a planner adds to odometry. When `jumps` has grown, it looks its goals up again.
Json navigation_json(const MapFrame::Notice& frame) {
  const Eigen::Vector3d& t = frame.T_map_odom.t;
  const Eigen::Quaterniond& q = frame.T_map_odom.q;
  return {{"map", {{"agent", frame.map.agent}, {"epoch", frame.map.epoch}, {"id", frame.map.id}}},
          {"T_map_odom", {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()}},
          {"jumps", frame.jumps},
          {"other_maps", frame.other_map}};
}

}  // namespace

nlohmann::ordered_json journal_json(const JournalStatus& status) {
  constexpr const char* kStates[] = {"off", "on", "waiting", "given_up", "removed", "moved"};
  const bool off = status.state == JournalStatus::State::kOff;
  Json json{{"state", kStates[static_cast<std::size_t>(status.state)]},
            {"flushed", off ? Json::object() : streams_json(status.flushed)}};
  if (off) return json;
  json["record_bytes"] = status.record_bytes;
  json["written_bytes"] = status.written_bytes;
  json["carried_bytes"] = status.carried_bytes;
  json["flushes"] = status.flushes;
  json["waiting_bytes"] = status.waiting_bytes;
  json["held_back"] = status.held_back;
  json["heard_dropped"] = status.heard_dropped;
  json["generation"] = status.generation;
  const bool moved = status.state == JournalStatus::State::kMoved;
  json["problem"] = moved               ? "the file was moved"
                    : status.error == 0 ? ""
                                        : std::strerror(status.error);
  return json;
}

nlohmann::ordered_json recorder_json(const FlightWriter* writer) {
  if (writer == nullptr) return {{"state", "off"}, {"file", ""}};
  return {{"state", writer->ended() ? "ended" : "on"},
          {"file", std::filesystem::absolute(writer->path()).string()},
          {"bytes", writer->bytes()},
          {"problem", writer->problem()}};
}

nlohmann::ordered_json gpio_json(const GpioStatus& status) {
  Json json{{"tracking", status.tracking},
            {"heartbeat", status.heartbeat},
            {"hold", status.hold},
            {"problems", status.problems}};
  if (status.has_pulse) {
    json["pulse"] = {
        {"locked", status.pulse.locked},       {"frequency_ppm", status.pulse.frequency_ppm},
        {"jitter_us", status.pulse.jitter_us}, {"phase_us", status.pulse.phase_us},
        {"pulses", status.pulse.pulses},       {"glitches", status.pulse.glitches},
        {"missed", status.pulse.missed}};
  }
  return json;
}

nlohmann::ordered_json gray_json(const GrayCamera& camera) {
  const Line state = camera.state();
  return {{"running", camera.running()},
          {"detail", std::string{view(state)}},
          {"images", camera.images()},
          {"paired", camera.paired.load()},
          {"alone", camera.alone.load()}};
}

nlohmann::ordered_json peer_json(const RadioStatus::PeerStatus& status) {
  const Peer& peer = status.peer;
  const double all = static_cast<double>(peer.datagrams + peer.lost);
  Json json{{"agent", peer.life.agent},
            {"epoch", peer.life.epoch},
            {"heard_s_ago", status.silent_s},
            {"in_sync", status.in_sync},
            {"ended", peer.superseded},
            {"records", peer.records},
            {"held", streams_json(status.held_of)},
            {"datagrams", peer.datagrams},
            {"loss", all > 0.0 ? static_cast<double>(peer.lost) / all : 0.0},
            {"bytes", peer.bytes},
            {"new_records", peer.new_records}};
  if (peer.has_offset) {
    json["clock_offset_s"] = seconds(peer.clock_offset);
    json["round_trip_s"] = seconds(peer.delay);
  }
  return json;
}

nlohmann::ordered_json status_json(const StatusBoard::Notice& notice, const MemoryStatus& memory,
                                   const RadioStatus* radio) {
  const StatusRecord& s = notice.status;
  Json json{{"agent", s.agent},
            {"epoch", s.epoch},
            {"state", to_string(s.state)},
            {"uptime_s", static_cast<double>(s.uptime_ms) / 1e3},
            {"frames",
             {{"read", s.frames_read},
              {"processed", s.frames_processed},
              {"dropped", s.frames_dropped}}}};
  json["latency"] = {{"p50_us", notice.latency.p50_us},
                     {"p99_us", notice.latency.p99_us},
                     {"max_us", notice.latency.max_us}};
  for (std::size_t i = 0; i < kStages; ++i) {
    const StageTime& t = s.stages[i];
    json["stages"][std::string{kStageNames[i]}] = {{"p50_us", t.p50_us},
                                                   {"p99_us", t.p99_us},
                                                   {"max_us", t.max_us},
                                                   {"deadline_misses", t.deadline_misses},
                                                   {"histogram", histogram_json(notice.wall[i])}};
  }
  json["memory"] = memory_json(memory, notice.fills);
  Json& track = json["tracking"];
  track = {{"now", s.tracking}, {"keyframes", s.keyframes}, {"lost", s.frames_lost}};
  add_tracking(notice.tracking, track);
  add_free_axes(notice.free, track);
  json["maplets"] = s.maplets;
  json["delta_poses"] = s.delta_poses;
  json["closures"] = s.closures;
  json["ranges"] = {{"measured", notice.ranges.measured},
                    {"placed", notice.ranges.placed},
                    {"dropped", notice.ranges.dropped}};
  const std::uint64_t held = radio ? radio->records_digest : 0;
  json["skeleton"] = {{"nodes", s.nodes},
                      {"factors", s.factors},
                      {"settled", notice.settled && notice.records_digest == held},
                      {"records_digest", hex(held)},
                      {"digest", hex(notice.skeleton_digest)}};
  json["navigation"] = navigation_json(notice.frame);
  json["peers"] = Json::array();
  if (radio) {
    json["exchange"] = exchange_json(*radio);
    json["security"] = security_json(radio->security);
    for (std::size_t i = 0; i < radio->peer_count; ++i) {
      json["peers"].push_back(peer_json(radio->peers[i]));
    }
  }
  json["journal"] = journal_json(JournalStatus{});
  return json;
}

}  // namespace maplet::daemon
