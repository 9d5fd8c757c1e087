// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/thread_setup.hpp"

#include <fmt/format.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>

#include <cstring>
#include <utility>

namespace maplet::daemon {

std::optional<std::string> set_up_this_thread(const char* name, int fifo_priority) {
  pthread_setname_np(pthread_self(), name);
  if (fifo_priority == 0) return {};
  sched_param parameters{};
  parameters.sched_priority = fifo_priority;
  const int error =
      pthread_setschedparam(pthread_self(), SCHED_FIFO | SCHED_RESET_ON_FORK, &parameters);
  if (error == 0) return {};
  return fmt::format(
      "thread {}: no real-time priority {} ({}): grant LimitRTPRIO={} or CAP_SYS_NICE, or set the "
      "priority to 0",
      name, fifo_priority, std::strerror(error), fifo_priority);
}

std::thread start_thread(const char* name, std::function<void()> body) {
  sigset_t all;
  sigset_t before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);  // the thread inherits it
  std::thread thread{std::move(body)};
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  pthread_setname_np(thread.native_handle(), name);
  return thread;
}

}  // namespace maplet::daemon
