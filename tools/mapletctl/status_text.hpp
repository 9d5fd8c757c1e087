// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace maplet::ctl {

/// The answer to "status" for a person.
void print_status(const nlohmann::ordered_json& status);
/// Whether the link is secured, and who was refused.
void print_security(const nlohmann::ordered_json& security);
void print_peer(const nlohmann::ordered_json& peer);

/// The answer to "status" in the text format that Prometheus reads: counters end in _total, bytes
/// and seconds are the units.
[[nodiscard]] std::string prometheus_text(const nlohmann::ordered_json& status);

}  // namespace maplet::ctl
