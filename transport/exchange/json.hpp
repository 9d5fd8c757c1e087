// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <boost/static_string/static_string.hpp>

#include "transport/exchange/delta_pose_record.hpp"
#include "transport/exchange/maplet_record.hpp"
#include "transport/exchange/status_record.hpp"

namespace maplet {

/// One JSON object without line end. Memory   inside the object, no heap.
using JsonLine = boost::static_strings::static_string<2048>;

/// The line of delta_poses.jsonl, and what `mapletctl watch --json` prints for the same record: the
/// numbers are those of restore(record), shortest form that reads back exactly.
[[nodiscard]] JsonLine to_json(const DeltaPoseRecord& record) noexcept;

/// Without the bytes themselves.
[[nodiscard]] JsonLine to_json(const MapletRecord& record) noexcept;

[[nodiscard]] JsonLine to_json(const StatusRecord& record) noexcept;

}  // namespace maplet
