// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>

namespace maplet::daemon {

/// Whether a thread gets on: it beats as it works, somebody else looks.
///
/// Memory   fixed. Threads  beat() and Waiting by the one that works, a Look by each that looks.
class Heartbeat {
 public:
  void beat() noexcept { beats_.fetch_add(1, std::memory_order_relaxed); }

  /// One who looks.
  class Look {
   public:
    explicit Look(const Heartbeat& heart) noexcept : heart_{heart} {}

    /// @return false when nothing happened since the last look, and the thread does not wait for
    ///   somebody else
    [[nodiscard]] bool moved_on() noexcept {
      const std::uint64_t beats = heart_.beats_.load(std::memory_order_relaxed);
      const bool moved = beats != seen_ || heart_.waiting_.load(std::memory_order_relaxed);
      seen_ = beats;
      return moved;
    }

   private:
    const Heartbeat& heart_;
    std::uint64_t seen_ = 0;
  };

  /// While it lives the thread is in others' hands (a camera's driver): standing still is no fault.
  class Waiting {
   public:
    explicit Waiting(Heartbeat& heart) noexcept : heart_{heart} { heart_.waiting_ = true; }
    ~Waiting() {
      heart_.waiting_ = false;
      heart_.beat();
    }
    Waiting(const Waiting&) = delete;
    Waiting& operator=(const Waiting&) = delete;

   private:
    Heartbeat& heart_;
  };

 private:
  std::atomic<std::uint64_t> beats_{0};
  std::atomic<bool> waiting_{false};
};

}  // namespace maplet::daemon
