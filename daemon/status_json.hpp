// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>

#include "daemon/flight_writer.hpp"
#include "daemon/gpio_panel.hpp"
#include "daemon/journal_writer.hpp"
#include "daemon/memory_status.hpp"
#include "daemon/radio_link.hpp"
#include "daemon/status_board.hpp"
#include "drivers/gray_camera.hpp"

namespace maplet::daemon {

/// Whether it is a whole number that fits.
template <class Number>
[[nodiscard]] bool is_number_of(const nlohmann::ordered_json& value) {
  return value.is_number_unsigned() &&
         value.get<std::uint64_t>() <= std::numeric_limits<Number>::max();
}

/// `mapletctl status --json`. @param radio  nullptr: --no-dds
[[nodiscard]] nlohmann::ordered_json status_json(const StatusBoard::Notice& notice,
                                                 const MemoryStatus& memory,
                                                 const RadioStatus* radio);

/// Its "journal".
[[nodiscard]] nlohmann::ordered_json journal_json(const JournalStatus& status);

/// Its "recorder". @param writer  nullptr: off
[[nodiscard]] nlohmann::ordered_json recorder_json(const FlightWriter* writer);

/// Its "gpio", where lines are used.
[[nodiscard]] nlohmann::ordered_json gpio_json(const GpioStatus& status);

/// Its "gray_camera", where there is one.
[[nodiscard]] nlohmann::ordered_json gray_json(const GrayCamera& camera);

/// One entry of its "peers".
[[nodiscard]] nlohmann::ordered_json peer_json(const RadioStatus::PeerStatus& status);

}  // namespace maplet::daemon
