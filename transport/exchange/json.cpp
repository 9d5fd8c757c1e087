// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/exchange/json.hpp"

#include <fmt/compile.h>
#include <fmt/format.h>

#include <cstdlib>
#include <iterator>

#include "core/geometry/planar_motion.hpp"

namespace maplet {

namespace {

template <class... Args>
void put(JsonLine& line, const Args&... args) {
  fmt::format_to(std::back_inserter(line), args...);
}

/// Seconds, exactly: no floating point, no zeros at the end.
void put_stamp(JsonLine& line, const char* name, Stamp stamp) {
  const auto ns = stamp.count();
  const auto whole = static_cast<unsigned long long>(ns < 0 ? -(ns + 1) : ns) + (ns < 0 ? 1U : 0U);
  put(line, FMT_COMPILE("\"{}\":{}{}.{:09}"), name, ns < 0 ? "-" : "", whole / 1000000000U,
      whole % 1000000000U);
  while (line.back() == '0') line.pop_back();
  if (line.back() == '.') line.push_back('0');
}

void put_maplet(JsonLine& line, const char* name, const MapletKey& key) {
  put(line, FMT_COMPILE("\"{}\":{{\"agent\":{},\"epoch\":{},\"id\":{}}}"), name, key.agent,
      key.epoch, key.id);
}

/// Always with a point or an exponent, -0 as 0.
template <class Number>
void put_number(JsonLine& line, Number value) {
  const std::size_t before = line.size();
  put(line, FMT_COMPILE("{}"), value == Number{0} ? Number{0} : value);
  if (line.find_first_of(".e", before) == JsonLine::npos) line.append(".0");
}

/// The paper's delta-pose: right, forward and the turn about down, in the plane across `up`, and
/// their covariance.
void put_planar(JsonLine& line, const DeltaPoseRecord& record) {
  const PlanarMotion planar{record.plane};
  line.append(",\"planar\":{\"up\":[");
  for (const double x : planar.up()) {
    put_number(line, x);
    line.push_back(',');
  }
  line.back() = ']';
  line.append(",\"delta\":[");
  for (const float x : {record.translation_m[0], record.translation_m[2], record.rotation_rad[1]}) {
    put_number(line, double{x});
    line.push_back(',');
  }
  line.back() = ']';
  line.append(",\"covariance\":[");
  const Matrix6d covariance = decode_covariance(record.covariance);
  for (const int i : {0, 2, 4}) {
    for (const int j : {0, 2, 4}) {
      put_number(line, covariance(i, j));
      line.push_back(',');
    }
  }
  line.back() = ']';
  line.push_back('}');
}

}  // namespace

JsonLine to_json(const DeltaPoseRecord& record) noexcept {
  const DeltaPose delta = restore(record);
  JsonLine line;
  put(line,
      FMT_COMPILE(
          "{{\"type\":\"delta_pose\",\"agent\":{},\"epoch\":{},\"stream\":\"{}\",\"seq\":{},"
          "\"kind\":\"{}\","),
      record.key.agent, record.key.epoch, to_string(record.key.stream), record.key.seq,
      record.kind == DeltaPose::Kind::kClosure ? "closure" : "consecutive");
  put_maplet(line, "a", record.a);
  line.push_back(',');
  put_maplet(line, "b", record.b);
  line.push_back(',');
  put_stamp(line, "stamp_a_s", record.stamp_a);
  line.push_back(',');
  put_stamp(line, "stamp_b_s", record.stamp_b);
  line.append(",\"T_a_b\":[");
  const Se3& T = delta.T_a_b.se3;
  for (const double value : {T.t.x(), T.t.y(), T.t.z(), T.q.x(), T.q.y(), T.q.z(), T.q.w()}) {
    put_number(line, value);
    line.push_back(',');
  }
  line.back() = ']';
  line.append(",\"covariance\":[");
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      put_number(line, delta.covariance(i, j));
      line.push_back(',');
    }
  }
  line.back() = ']';
  if (record.plane != PlaneCode::kSpace) put_planar(line, record);
  line.append(",\"overlap\":");
  put_number(line, delta.overlap);
  put(line, FMT_COMPILE(",\"matches\":{}}}"), delta.matches);
  return line;
}

JsonLine to_json(const MapletRecord& record) noexcept {
  JsonLine line;
  put(line, FMT_COMPILE("{{\"type\":\"maplet\",\"agent\":{},\"epoch\":{},\"id\":{},"),
      record.key.agent, record.key.epoch, record.key.id);
  put_stamp(line, "stamp_s", record.stamp);
  put(line, FMT_COMPILE(",\"bytes\":{},\"planes\":{},\"keyframes\":{}}}"), record.bytes.size(),
      record.planes, record.keyframes);
  return line;
}

JsonLine to_json(const StatusRecord& record) noexcept {
  JsonLine line;
  put(line, FMT_COMPILE("{{\"type\":\"status\",\"agent\":{},\"epoch\":{},\"state\":\"{}\","),
      record.agent, record.epoch, to_string(record.state));
  put_stamp(line, "stamp_s", record.stamp);
  put(line,
      FMT_COMPILE(",\"uptime_ms\":{},\"frames\":{{\"read\":{},\"processed\":{},\"dropped\":{}}},"
                  "\"tracking\":{{\"now\":{},\"keyframes\":{},\"lost\":{}}},"),
      record.uptime_ms, record.frames_read, record.frames_processed, record.frames_dropped,
      record.tracking, record.keyframes, record.frames_lost);
  put(line,
      FMT_COMPILE("\"maplets\":{},\"delta_poses\":{},\"closures\":{},\"skeleton\":{{\"nodes\":{},"
                  "\"factors\":{}}},\"messages_dropped\":{},"),
      record.maplets, record.delta_poses, record.closures, record.nodes, record.factors,
      record.messages_dropped);
  put(line, FMT_COMPILE("\"memory\":{{\"arena_bytes\":{},\"rss_bytes\":{}}},\"stages\":{{"),
      record.arena_bytes, record.rss_bytes);
  for (std::size_t i = 0; i < kStageNames.size(); ++i) {
    const StageTime& t = record.stages[i];
    put(line,
        FMT_COMPILE(
            "{}\"{}\":{{\"p50_us\":{},\"p99_us\":{},\"max_us\":{},\"deadline_misses\":{}}}"),
        i == 0 ? "" : ",", kStageNames[i], t.p50_us, t.p99_us, t.max_us, t.deadline_misses);
  }
  line.append("}}");
  return line;
}

}  // namespace maplet
