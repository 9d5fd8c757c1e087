// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/flight_writer.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <utility>

#include "core/limits.hpp"
#include "daemon/log.hpp"
#include "daemon/thread_setup.hpp"
#include "drivers/flight/depth_code.hpp"

namespace maplet::daemon {

using namespace std::chrono_literals;

FlightWriter::FlightWriter(std::unique_ptr<flight::RingWriter> ring, std::string path,
                           std::size_t queue_bytes)
    : ring_{std::move(ring)}, path_{std::move(path)}, queue_{queue_bytes}, capacity_{queue_bytes} {
  item_.reserve(queue_bytes);
  coded_.reserve(queue_bytes);
  thread_ = start_thread("recorder", [this] { loop(); });
}

FlightWriter::~FlightWriter() {
  stop_ = true;
  thread_.join();
}

void FlightWriter::put(flight::Block type, std::span<const std::byte> bytes,
                       bool patient) noexcept {
  const Item item{type, static_cast<std::uint32_t>(bytes.size())};
  const std::size_t need = sizeof item + bytes.size();
  while (patient && need <= capacity_ && !ended_ && queue_.write_available() < need)
    std::this_thread::sleep_for(1ms);
  if (ended_ || queue_.write_available() < need) {
    ended_ = true;
    return;
  }
  queue_.push(reinterpret_cast<const std::byte*>(&item), sizeof item);
  queue_.push(bytes.data(), bytes.size());
}

bool FlightWriter::take() {
  Item item;
  if (queue_.read_available() < sizeof item) return false;
  queue_.pop(reinterpret_cast<std::byte*>(&item), sizeof item);
  item_.resize(item.bytes);
  for (std::size_t at = 0; at < item_.size();) {
    const std::size_t count = queue_.pop(item_.data() + at, item_.size() - at);
    if (count == 0) std::this_thread::yield();
    at += count;
  }
  const std::vector<std::byte>* bytes = &item_;
  if (item.type == flight::Block::kDepth) {
    flight::encode_depth({reinterpret_cast<const std::uint16_t*>(item_.data()), item_.size() / 2},
                         coded_);
    bytes = &coded_;
  }
  const std::scoped_lock lock{ring_mutex_};
  if (broken_) return true;  // a hole in it would be taken for what ran
  errno = 0;
  if (ring_->put(item.type, *bytes)) {
    bytes_ += bytes->size();
    return true;
  }
  error_ = errno;
  broken_ = true;
  ended_ = true;
  return true;
}

std::string FlightWriter::problem() const {
  if (!ended_) return {};
  const int error = error_;
  return error == 0 ? "the disk is too slow" : std::strerror(error);
}

void FlightWriter::loop() {
  bool said = false;
  while (true) {
    const bool stopping = stop_;
    while (take()) {
    }
    if (ended_ && !std::exchange(said, true)) {
      log_warning(fmt::format("{}: the recording ends here: {}", path_, problem()));
    }
    if (stopping) break;
    std::this_thread::sleep_for(5ms);
  }
  const std::scoped_lock lock{ring_mutex_};
  (void)ring_->flush();
}

std::string FlightWriter::save(const std::string& to) {
  std::this_thread::sleep_for(50ms);  // what was recorded before the question
  const std::scoped_lock lock{ring_mutex_};
  if (!ring_->flush()) return path_ + ": cannot be written";
  auto reader = ring_->reader();
  return reader ? (*reader)->save(to) : reader.error();
}

}  // namespace maplet::daemon
