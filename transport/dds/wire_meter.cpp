// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/dds/wire_meter.hpp"

namespace maplet {

std::atomic<bool> WireMeter::available{false};
std::atomic<std::uint32_t> WireMeter::first_port{0};
std::atomic<std::uint64_t> WireMeter::bytes{0};
std::atomic<std::uint64_t> WireMeter::datagrams{0};

}  // namespace maplet
