// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <semaphore.h>

#include <ctime>

#include "core/base/clock.hpp"

namespace maplet {

/// Posting never blocks: what std::condition_variable cannot promise.
class Wake {
 public:
  Wake() noexcept { sem_init(&semaphore_, 0, 0); }
  ~Wake() { sem_destroy(&semaphore_); }
  Wake(const Wake&) = delete;
  Wake& operator=(const Wake&) = delete;
  void post() noexcept { sem_post(&semaphore_); }
  void wait(Duration limit) noexcept {
    timespec until{};
    clock_gettime(CLOCK_MONOTONIC, &until);
    const auto ns = until.tv_nsec + limit.count();
    until.tv_sec += static_cast<time_t>(ns / 1'000'000'000);
    until.tv_nsec = static_cast<long>(ns % 1'000'000'000);
    (void)sem_clockwait(&semaphore_, CLOCK_MONOTONIC, &until);
  }

 private:
  sem_t semaphore_{};
};

}  // namespace maplet
