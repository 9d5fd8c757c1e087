// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/signals.hpp"

#include <csignal>

namespace maplet::daemon {

namespace {

std::atomic<bool> stop{false};
std::atomic<bool> reload{false};
static_assert(std::atomic<bool>::is_always_lock_free);  // a signal handler writes them

extern "C" void on_stop(int) { stop = true; }
extern "C" void on_reload(int) { reload = true; }

void handle(int signal, void (*handler)(int)) {
  struct sigaction action {};
  action.sa_handler = handler;
  sigaction(signal, &action, nullptr);
}

}  // namespace

void catch_signals(bool service) {
  handle(SIGTERM, on_stop);
  handle(SIGINT, on_stop);
  handle(SIGHUP, service ? on_reload : on_stop);
  handle(SIGPIPE, SIG_IGN);
}

const std::atomic<bool>& stop_asked() noexcept { return stop; }

bool take_reload() noexcept { return reload.exchange(false); }

}  // namespace maplet::daemon
