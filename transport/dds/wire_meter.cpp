// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/dds/wire_meter.hpp"

#include <algorithm>
#include <array>
#include <mutex>
#include <numeric>

#include "transport/dds/handshake_pace.hpp"

namespace maplet {

namespace {

/// IP bytes of the last ten seconds, never less.
class Window {
 public:
  /// @return false, and nothing is added: beyond `most`
  bool add(std::size_t bytes, std::uint64_t most, Instant now) noexcept {
    const std::scoped_lock lock{mutex_};
    const auto bin = static_cast<std::uint64_t>(now.time_since_epoch() / kBin);
    for (; bin_ < bin && bin - bin_ <= kBins; ++bin_) at(bin_ + 1) = 0;
    if (bin_ < bin) bins_ = {};
    bin_ = std::max(bin_, bin);
    const std::uint64_t sent = std::accumulate(bins_.begin(), bins_.end(), std::uint64_t{0});
    if (most > 0 && sent + bytes > most) return false;
    at(bin_) += bytes;
    return true;
  }

 private:
  std::uint64_t& at(std::uint64_t bin) noexcept {
    return bins_[static_cast<std::size_t>(bin % kBins)];
  }

  static constexpr Duration kBin = std::chrono::milliseconds{250};
  static constexpr std::size_t kBins = static_cast<std::size_t>(WireMeter::kWindow / kBin) + 1;

  std::mutex mutex_;
  std::array<std::uint64_t, kBins> bins_{};
  std::uint64_t bin_ = 0;
};

Window window;

/// What DDS Security says to those whom it does not know.
struct Introductions {
  std::mutex mutex;
  HandshakePace pace;
  Window window;

  bool allow(const GuidPrefix& to, std::size_t bytes, std::uint64_t most, Instant now) noexcept {
    const std::scoped_lock lock{mutex};
    return pace.allows(to, now) && window.add(bytes, most / 2, now);
  }
};

Introductions introductions;

}  // namespace

std::atomic<bool> WireMeter::available{false};
std::atomic<std::uint32_t> WireMeter::first_port{0};
std::atomic<std::uint64_t> WireMeter::bytes{0};
std::atomic<std::uint64_t> WireMeter::datagrams{0};
std::atomic<std::uint64_t> WireMeter::held_back{0};
std::atomic<std::uint64_t> WireMeter::most_in_a_window{0};

bool WireMeter::pass(std::size_t payload, Instant now) noexcept {
  if (!window.add(payload + kIpUdpBytes, most_in_a_window.load(std::memory_order_relaxed), now)) {
    held_back.fetch_add(1, std::memory_order_relaxed);
    return false;
  }
  bytes.fetch_add(payload + kIpUdpBytes, std::memory_order_relaxed);
  datagrams.fetch_add(1, std::memory_order_relaxed);
  return true;
}

bool WireMeter::pass(std::span<const std::byte> head, std::size_t payload, Instant now) noexcept {
  const auto to = introduced_to(head);
  if (to && !introductions.allow(*to, payload + kIpUdpBytes,
                                 most_in_a_window.load(std::memory_order_relaxed), now)) {
    held_back.fetch_add(1, std::memory_order_relaxed);
    return false;
  }
  return pass(payload, now);
}

}  // namespace maplet
