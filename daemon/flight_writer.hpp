// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <boost/lockfree/spsc_queue.hpp>
#include <memory>
#include <mutex>
#include <span>
#include <thread>
#include <vector>

#include "drivers/flight/flight_file.hpp"

namespace maplet::daemon {

/// A thread that puts what is recorded into the ring.
///
/// Memory   the queue, and twice a frame; at construction, but for the first frames of a new size.
/// Threads  put() from the estimator's, without waiting; save() from any.
class FlightWriter {
 public:
  FlightWriter(std::unique_ptr<flight::RingWriter> ring, std::string path, std::size_t queue_bytes);
  ~FlightWriter();
  FlightWriter(const FlightWriter&) = delete;
  FlightWriter& operator=(const FlightWriter&) = delete;

  /// @param patient  waits for room instead of ending the recording
  void put(flight::Block type, std::span<const std::byte> bytes, bool patient) noexcept;
  /// Something did not fit: what came after it is not recorded.
  [[nodiscard]] bool ended() const noexcept { return ended_; }
  [[nodiscard]] const std::string& path() const noexcept { return path_; }
  /// Recorded since the start, as coded; a ring holds the last of it.
  [[nodiscard]] std::uint64_t bytes() const noexcept { return bytes_; }
  /// Why it ended; empty: it goes on.
  [[nodiscard]] std::string problem() const;
  /// Copies what is recorded up to now. @return why not
  [[nodiscard]] std::string save(const std::string& to);

 private:
  struct Item {
    flight::Block type{};
    std::uint32_t bytes = 0;
  };
  void loop();
  bool take();

  std::unique_ptr<flight::RingWriter> ring_;
  std::string path_;
  boost::lockfree::spsc_queue<std::byte> queue_;
  std::size_t capacity_;
  std::vector<std::byte> item_;
  std::vector<std::byte> coded_;
  bool broken_ = false;  ///< the disk: nothing more is written
  std::atomic<bool> ended_{false};
  std::atomic<int> error_{0};  ///< errno of the disk; 0: it was too slow
  std::atomic<std::uint64_t> bytes_{0};
  std::atomic<bool> stop_{false};
  std::mutex ring_mutex_;
  std::thread thread_;
};

}  // namespace maplet::daemon
