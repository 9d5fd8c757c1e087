// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/dds/messages.hpp"

#include <algorithm>
#include <memory>

namespace maplet {

namespace {

maplet_msg_MapletKey to_message(const MapletKey& key) noexcept {
  return {.epoch = key.epoch, .id = key.id, .agent = key.agent};
}

MapletKey from_message(const maplet_msg_MapletKey& key) noexcept {
  return {key.agent, key.epoch, key.id};
}

struct DeleteQos {
  void operator()(dds_qos_t* qos) const noexcept { dds_delete_qos(qos); }
};

std::unique_ptr<dds_qos_t, DeleteQos> common_qos() noexcept {
  std::unique_ptr<dds_qos_t, DeleteQos> qos{dds_create_qos()};
  dds_qset_reliability(qos.get(), DDS_RELIABILITY_RELIABLE, DDS_MSECS(100));
  dds_qset_durability(qos.get(), DDS_DURABILITY_TRANSIENT_LOCAL);
  return qos;
}

}  // namespace

maplet_msg_DeltaPose to_message(const DeltaPoseRecord& record) noexcept {
  maplet_msg_DeltaPose message{};
  message.agent = record.key.agent;
  message.epoch = record.key.epoch;
  message.stream = static_cast<std::uint8_t>(record.key.stream);
  message.seq = record.key.seq;
  message.kind = static_cast<std::uint8_t>(record.kind);
  message.a = to_message(record.a);
  message.b = to_message(record.b);
  message.stamp_a_ns = record.stamp_a.count();
  message.stamp_b_ns = record.stamp_b.count();
  std::copy_n(record.translation_m.begin(), 3, message.translation_m);
  std::copy_n(record.rotation_rad.begin(), 3, message.rotation_rad);
  std::copy_n(record.covariance.sigma.begin(), 6, message.sigma);
  std::copy_n(record.covariance.shape.begin(), 15, message.shape);
  std::copy_n(record.covariance.pivot.begin(), 5, message.pivot);
  if (record.plane != PlaneCode::kSpace) {
    const Eigen::Vector3f up = PlanarMotion{record.plane}.up().cast<float>();
    std::copy_n(up.data(), 3, message.plane_up);
  }
  message.overlap = record.overlap;
  message.matches = record.matches;
  return message;
}

DeltaPoseRecord from_message(const maplet_msg_DeltaPose& message) noexcept {
  DeltaPoseRecord record;
  record.key = {message.agent, message.epoch, static_cast<Stream>(message.stream), message.seq};
  record.kind = static_cast<DeltaPose::Kind>(message.kind);
  record.a = from_message(message.a);
  record.b = from_message(message.b);
  record.stamp_a = Stamp{message.stamp_a_ns};
  record.stamp_b = Stamp{message.stamp_b_ns};
  std::copy_n(message.translation_m, 3, record.translation_m.begin());
  std::copy_n(message.rotation_rad, 3, record.rotation_rad.begin());
  std::copy_n(message.sigma, 6, record.covariance.sigma.begin());
  std::copy_n(message.shape, 15, record.covariance.shape.begin());
  std::copy_n(message.pivot, 5, record.covariance.pivot.begin());
  const Eigen::Vector3d up = Eigen::Vector3f{message.plane_up}.cast<double>();
  if (!up.isZero(0.0)) record.plane = PlanarMotion{up}.code();
  record.overlap = message.overlap;
  record.matches = message.matches;
  return record;
}

maplet_msg_Maplet to_message(const MapletRecord& record) noexcept {
  maplet_msg_Maplet message{};
  message.agent = record.key.agent;
  message.epoch = record.key.epoch;
  message.id = record.key.id;
  message.stamp_ns = record.stamp.count();
  message.planes = record.planes;
  message.keyframes = record.keyframes;
  message.data._length = static_cast<std::uint32_t>(record.bytes.size());
  message.data._maximum = message.data._length;
  message.data._buffer =
      reinterpret_cast<std::uint8_t*>(const_cast<std::byte*>(record.bytes.data()));
  return message;
}

MapletRecord from_message(const maplet_msg_Maplet& message) noexcept {
  return {{message.agent, message.epoch, message.id},
          Stamp{message.stamp_ns},
          message.planes,
          message.keyframes,
          {reinterpret_cast<const std::byte*>(message.data._buffer), message.data._length}};
}

maplet_msg_Status to_message(const StatusRecord& record) noexcept {
  maplet_msg_Status message{};
  message.agent = record.agent;
  message.epoch = record.epoch;
  message.state = static_cast<std::uint8_t>(record.state);
  message.tracking = record.tracking ? 1 : 0;
  message.stamp_ns = record.stamp.count();
  message.uptime_ms = record.uptime_ms;
  message.frames_read = record.frames_read;
  message.frames_processed = record.frames_processed;
  message.frames_dropped = record.frames_dropped;
  message.frames_lost = record.frames_lost;
  message.keyframes = record.keyframes;
  message.maplets = record.maplets;
  message.delta_poses = record.delta_poses;
  message.closures = record.closures;
  message.nodes = record.nodes;
  message.factors = record.factors;
  message.messages_dropped = record.messages_dropped;
  message.arena_bytes = record.arena_bytes;
  message.rss_bytes = record.rss_bytes;
  for (std::size_t i = 0; i < record.stages.size(); ++i) {
    const StageTime& t = record.stages[i];
    message.stages[i] = {t.p50_us, t.p99_us, t.max_us, t.deadline_misses};
  }
  return message;
}

StatusRecord from_message(const maplet_msg_Status& message) noexcept {
  StatusRecord record;
  record.agent = message.agent;
  record.epoch = message.epoch;
  record.state = static_cast<StatusRecord::State>(message.state);
  record.tracking = message.tracking != 0;
  record.stamp = Stamp{message.stamp_ns};
  record.uptime_ms = message.uptime_ms;
  record.frames_read = message.frames_read;
  record.frames_processed = message.frames_processed;
  record.frames_dropped = message.frames_dropped;
  record.frames_lost = message.frames_lost;
  record.keyframes = message.keyframes;
  record.maplets = message.maplets;
  record.delta_poses = message.delta_poses;
  record.closures = message.closures;
  record.nodes = message.nodes;
  record.factors = message.factors;
  record.messages_dropped = message.messages_dropped;
  record.arena_bytes = message.arena_bytes;
  record.rss_bytes = message.rss_bytes;
  for (std::size_t i = 0; i < record.stages.size(); ++i) {
    const maplet_msg_StageTime& t = message.stages[i];
    record.stages[i] = {t.p50_us, t.p99_us, t.max_us, t.deadline_misses};
  }
  return record;
}

dds_entity_t make_topic(dds_entity_t participant, TopicKind kind) noexcept {
  switch (kind) {
    case TopicKind::kDeltaPose:
      return dds_create_topic(participant, &maplet_msg_DeltaPose_desc, kDeltaPoseTopic.data(),
                              nullptr, nullptr);
    case TopicKind::kMaplet:
      return dds_create_topic(participant, &maplet_msg_Maplet_desc, kMapletTopic.data(), nullptr,
                              nullptr);
    case TopicKind::kStatus:
      return dds_create_topic(participant, &maplet_msg_Status_desc, kStatusTopic.data(), nullptr,
                              nullptr);
  }
  return DDS_RETCODE_BAD_PARAMETER;
}

dds_entity_t make_writer(dds_entity_t participant, dds_entity_t topic, int history) noexcept {
  const auto qos = common_qos();
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, history);
  dds_qset_durability_service(qos.get(), 0, DDS_HISTORY_KEEP_LAST, history, DDS_LENGTH_UNLIMITED,
                              DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED);
  // What an agent said stays true when its process ends.
  dds_qset_writer_data_lifecycle(qos.get(), false);
  return dds_create_writer(participant, topic, qos.get(), nullptr);
}

dds_entity_t make_reader(dds_entity_t participant, dds_entity_t topic, int history) noexcept {
  const auto qos = common_qos();
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_ALL, 0);
  dds_qset_resource_limits(qos.get(), history, DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED);
  return dds_create_reader(participant, topic, qos.get(), nullptr);
}

}  // namespace maplet
