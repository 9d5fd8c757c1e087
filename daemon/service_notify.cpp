// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/service_notify.hpp"

#include <fmt/format.h>
#include <systemd/sd-daemon.h>

#include <array>

namespace maplet::daemon {

void notify_ready() noexcept { sd_notify(0, "READY=1"); }
void notify_stopping() noexcept { sd_notify(0, "STOPPING=1"); }

void notify_status(const char* status) noexcept {
  std::array<char, 256> line{};
  fmt::format_to_n(line.data(), line.size() - 1, "STATUS={}", status);
  sd_notify(0, line.data());
}

}  // namespace maplet::daemon
