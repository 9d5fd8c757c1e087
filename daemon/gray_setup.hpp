// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <tl/expected.hpp>

#include "daemon/gray_config.hpp"
#include "drivers/gray_camera.hpp"

namespace maplet::daemon {

/// The section [gray_camera] as the driver takes it. @return what is wrong with it, on one line
[[nodiscard]] tl::expected<GrayCameraOptions, std::string> gray_options(const GrayConfig& config);

}  // namespace maplet::daemon
