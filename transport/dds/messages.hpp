// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Between records and the C structs of transport/idl. Included by this folder's sources only.
#pragma once

#include <dds/dds.h>
#include <maplet_msg.h>

#include "transport/dds/config.hpp"
#include "transport/exchange/delta_pose_record.hpp"
#include "transport/exchange/maplet_record.hpp"
#include "transport/exchange/status_record.hpp"

namespace maplet {

[[nodiscard]] maplet_msg_DeltaPose to_message(const DeltaPoseRecord& record) noexcept;
/// The bytes are lent, not copied: dds_write() reads them, nobody frees them.
[[nodiscard]] maplet_msg_Maplet to_message(const MapletRecord& record) noexcept;
[[nodiscard]] maplet_msg_Status to_message(const StatusRecord& record) noexcept;

[[nodiscard]] DeltaPoseRecord from_message(const maplet_msg_DeltaPose& message) noexcept;
[[nodiscard]] MapletRecord from_message(const maplet_msg_Maplet& message) noexcept;
[[nodiscard]] StatusRecord from_message(const maplet_msg_Status& message) noexcept;

enum class TopicKind : std::uint8_t { kDeltaPose, kMaplet, kStatus };

/// @return the topic, negative when Cyclone refused
[[nodiscard]] dds_entity_t make_topic(dds_entity_t participant, TopicKind kind) noexcept;

/// RELIABLE, TRANSIENT_LOCAL. A writer keeps the last `history` samples of each agent, for late
/// readers too, and never waits for a slow reader; a reader keeps up to `history` untaken ones.
[[nodiscard]] dds_entity_t make_writer(dds_entity_t participant, dds_entity_t topic,
                                       int history) noexcept;
[[nodiscard]] dds_entity_t make_reader(dds_entity_t participant, dds_entity_t topic,
                                       int history) noexcept;

}  // namespace maplet
