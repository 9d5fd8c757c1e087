// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/report.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "daemon/alloc_counter.hpp"
#include "daemon/histogram_json.hpp"
#include "daemon/memory_status.hpp"
#include "daemon/tracking_json.hpp"
#include "transport/exchange/delta_pose_record.hpp"

namespace maplet::daemon {

namespace {

using Json = nlohmann::ordered_json;

double us(Duration duration) { return static_cast<double>(duration.count()) / 1000.0; }

Json stage_json(const StageStats& stats) {
  return {{"p50_us", us(stats.wall.percentile(0.5))},
          {"p99_us", us(stats.wall.percentile(0.99))},
          {"max_us", us(stats.wall.max())},
          {"cpu_p50_us", us(stats.cpu.percentile(0.5))},
          {"cpu_p99_us", us(stats.cpu.percentile(0.99))},
          {"count", stats.wall.count()},
          {"deadline_misses", stats.deadline_misses},
          {"histogram", histogram_json(stats.wall.told())}};
}

double mean(std::uint64_t sum, std::uint64_t count) {
  return count == 0 ? 0.0 : static_cast<double>(sum) / static_cast<double>(count);
}

Json exchange_json(const RadioStatus& radio) {
  return {{"agents_heard", radio.peer_count},
          {"wire_bytes", radio.wire_bytes},
          {"dds_bytes", radio.dds_bytes},
          {"delta_pose_bytes", radio.lane_bytes[0]},
          {"closure_bytes", radio.lane_bytes[1]},
          {"range_bytes", radio.lane_bytes[2]},
          {"control_bytes", radio.lane_bytes[3]},
          {"maplet_bytes", radio.lane_bytes[4]},
          {"records", radio.records},
          {"received", radio.counters.received},
          {"maplets_received", radio.maplets.received}};
}

// What a maplet has, and what found no room or no plane.
Json kept_json(const MapletCounts& counts) {
  return {{"patches_placed", counts.patches_placed}, {"patches_unfit", counts.patches_unfit},
          {"patches_loose", counts.patches_loose},   {"quads_kept", counts.quads_kept},
          {"quads_left_out", counts.quads_left_out}, {"cells_seen_through", counts.cells_carved},
          {"planes_dropped", counts.planes_dropped}, {"planes_trimmed", counts.planes_trimmed},
          {"tiles_missing", counts.tiles_missing},   {"looks_cut_short", counts.deadline_misses},
          {"hidden_origins", counts.hidden_origins}};
}

Json links_json(const RegistrarCounts& counts) {
  return {{"odometry_alone", counts.odometry_alone},
          {"contradicted", counts.contradicted},
          {"with_free_axes", counts.with_free_axes},
          {"deadline_misses", counts.deadline_misses}};
}

Json memory_json(std::size_t arena_bytes) {
  Json memory{{"arena_bytes", arena_bytes}, {"peak_rss_bytes", peak_rss_bytes()}};
  if (allocation_counting_available()) {
    memory["heap_allocations_after_ready"] = allocation_counts().ours;
    memory["third_party_allocations"] = allocation_counts().third_party;
  } else {  // under a sanitizer nobody counts
    memory["heap_allocations_after_ready"] = nullptr;
    memory["third_party_allocations"] = nullptr;
  }
  return memory;
}

}  // namespace

std::string report_json(const RunTotals& totals, const SourceCounters& source,
                        const StageMeters& meters, std::size_t arena_bytes,
                        const RadioStatus* radio, const Agent& agent) {
  const Skeleton& skeleton = agent.skeleton();
  Json report;
  report["version"] = MAPLET_VERSION;
  report["complete"] = totals.complete;
  report["frames"] = {{"read", source.read},
                      {"processed", totals.processed},
                      {"dropped", source.dropped + totals.dropped},
                      {"unreadable", source.unreadable},
                      {"out_of_order", source.out_of_order}};
  for (std::size_t i = 0; i < kStages; ++i) {
    report["stages"][kStageNames[i]] = stage_json(meters.of(static_cast<Stage>(i)));
  }
  Json& track = report["tracking"];
  track = {{"keyframes", totals.keyframes}, {"lost", totals.lost}};
  add_tracking(agent.tracking(), track);
  track["partly_free"] = totals.partly_free;
  if (const auto plane = agent.plane()) {
    track["off_plane"] = plane->off;
    track["plane"] = {{"up", {plane->up.x(), plane->up.y(), plane->up.z()}},
                      {"from", to_string(plane->from)}};
  }
  add_free_axes(totals.free, track);
  report["maplets"] = {
      {"count", totals.maplets},
      {"bytes_min", totals.maplet_bytes_min},
      {"bytes_mean", mean(totals.maplet_bytes, totals.maplets)},
      {"bytes_max", totals.maplet_bytes_max},
      {"planes_mean", mean(totals.maplet_planes, totals.maplets)},
      {"points_left_out_share", 1.0 - mean(totals.points.kept, totals.points.seen)},
      {"point_cloud_bytes_mean", mean(totals.point_cloud_bytes, totals.maplets)},
      {"kept", kept_json(agent.maplet_counts())}};
  report["delta_poses"] = {
      {"count", totals.delta_poses},
      {"closures", totals.closures},
      {"ranges", totals.ranges},
      {"unrelated", totals.unrelated},
      {"payload_bytes_mean", totals.delta_poses == 0 ? 0 : kDeltaPosePayloadBytes},
      {"links", links_json(agent.link_counts())}};
  const SkeletonCounters skeleton_counters = skeleton.counters();
  report["skeleton"] = {{"nodes", skeleton.node_count()},
                        {"factors", skeleton.factor_count()},
                        {"settled", skeleton.canonical()},
                        {"digest", fmt::format("{:016x}", skeleton.records_digest())},
                        {"condensed", skeleton_counters.condensed},
                        {"dropped", skeleton_counters.dropped},
                        {"nodes_full", skeleton_counters.nodes_full},
                        {"factors_full", skeleton_counters.factors_full},
                        {"overflows", skeleton_counters.overflows}};
  report["memory"] = memory_json(arena_bytes);
  if (radio != nullptr && radio->peer_count > 0) report["exchange"] = exchange_json(*radio);
  return report.dump(2) + "\n";
}

}  // namespace maplet::daemon
