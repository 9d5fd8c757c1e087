// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <mutex>
#include <utility>

#include "transport/exchange/status_record.hpp"

namespace maplet::daemon {

/// The newest status, for the threads that tell others.
///
/// Memory   fixed. Threads  note() by the estimator's, without waiting: when somebody reads just
///   then, the next second will do; the rest by any.
class StatusBoard {
 public:
  struct Notice {
    StatusRecord status;
    bool settled = false;  ///< the skeleton, with every record that anybody heard holds
  };

  void note(const StatusRecord& status, bool settled) noexcept {
    const std::unique_lock lock{mutex_, std::try_to_lock};
    if (lock) notice_ = {status, settled};
  }
  [[nodiscard]] Notice read() const {
    const std::scoped_lock lock{mutex_};
    return notice_;
  }

 private:
  mutable std::mutex mutex_;
  Notice notice_;
};

}  // namespace maplet::daemon
