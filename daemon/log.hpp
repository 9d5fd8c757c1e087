// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace maplet::daemon {

/// One line each: what, where, what to do. To the journal when systemd started us, else to standard
/// error as `mapletd: ...`. Allocates: not for the frame path.
void log_info(std::string_view line);
void log_warning(std::string_view line);
void log_error(std::string_view line);

/// Warnings that could go on for ever: the first few are said, the rest only counted by whoever
/// reports. Does not allocate for lines of up to 200 characters.
class FewLines {
 public:
  void say(std::string_view line);

 private:
  int left_ = 10;
};

}  // namespace maplet::daemon
