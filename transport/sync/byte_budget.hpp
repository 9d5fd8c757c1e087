// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "core/base/clock.hpp"

namespace maplet {

/// How many bytes a link may still carry: a token bucket that evens the flow out, inside a window
/// of ten seconds that is never overdrawn.
///
/// What others send on the same link without asking (DDS's own announcements) is charged too; the
/// most they took in one window of the last minutes is kept free for them, up to a quarter.
///
/// Memory   fixed. Time O(1), bins of the window that have passed apart. Threads one.
class ByteBudget {
 public:
  static constexpr Duration kWindow = std::chrono::seconds{10};
  static constexpr Duration kForget = std::chrono::seconds{30};  ///< half of what others took

  /// @param bytes_per_s  IP bytes
  /// @param burst_bytes  may go at once; at least the largest datagram on the wire
  ByteBudget(double bytes_per_s, std::size_t burst_bytes, Instant now) noexcept
      : rate_{bytes_per_s}, burst_{static_cast<double>(burst_bytes)}, tokens_{burst_}, last_{now} {}

  /// Our own bytes went out.
  void charge(std::size_t bytes, Instant now) noexcept { add(ours_, bytes, now); }
  /// Bytes of others went out.
  void charge_others(std::size_t bytes, Instant now) noexcept {
    add(others_, bytes, now);
    others_peak_ = std::max(others_peak_, static_cast<double>(sum(others_)));
  }

  /// Whether a datagram of `bytes` on the wire may go now. Bulk leaves room: what is urgent does
  /// not wait behind it.
  [[nodiscard]] bool allows(std::size_t bytes, Instant now, bool bulk = true) noexcept {
    advance(now);
    if (tokens_ <= (bulk ? 0.0 : -kUrgentBursts * burst_)) return false;
    const double all = rate_ * seconds(kWindow) * (bulk ? bulk_share_ : 1.0);
    const auto others = static_cast<double>(sum(others_));
    const double reserve = std::clamp(others_peak_ - others, 0.0, all / 4.0);
    return static_cast<double>(sum(ours_) + bytes) + others + reserve <= all;
  }

  /// Somebody who was heard is not any more: once they are back there must be room for records.
  void set_apart(bool apart) noexcept { bulk_share_ = apart ? kBulkShareApart : kBulkShare; }
  void set_rate(double bytes_per_s) noexcept { rate_ = bytes_per_s; }
  [[nodiscard]] double bytes_per_s() const noexcept { return rate_; }
  /// Bytes of the last ten seconds.
  [[nodiscard]] std::uint64_t window_bytes(Instant now) noexcept {
    advance(now);
    return sum(ours_) + sum(others_);
  }

 private:
  static constexpr std::size_t kBins = 42;  // a little more than the window: it never begins late
  static constexpr Duration kBin = std::chrono::milliseconds{250};
  static constexpr double kBulkShare = 0.9;
  static constexpr double kBulkShareApart = 0.5;
  static constexpr double kUrgentBursts = 3.0;  // what is urgent may borrow
  using Bins = std::array<std::uint32_t, kBins>;

  static std::uint64_t sum(const Bins& bins) noexcept {
    std::uint64_t total = 0;
    for (const std::uint32_t bin : bins) total += bin;
    return total;
  }
  void add(Bins& bins, std::size_t bytes, Instant now) noexcept {
    advance(now);
    bins[at_] += static_cast<std::uint32_t>(bytes);
    tokens_ = std::max(tokens_ - static_cast<double>(bytes), -2.0 * kUrgentBursts * burst_);
  }
  void advance(Instant now) noexcept {
    if (now <= last_) return;
    tokens_ = std::min(burst_, tokens_ + rate_ * seconds(now - last_));
    others_peak_ *= std::exp2(-seconds(now - last_) / seconds(kForget));
    last_ = now;
    const auto bin = static_cast<std::uint64_t>(now.time_since_epoch() / kBin);
    if (bin_ == 0) bin_ = bin;
    for (std::uint64_t passed = std::min<std::uint64_t>(bin - bin_, kBins); passed > 0; --passed) {
      at_ = (at_ + 1) % kBins;
      ours_[at_] = 0;
      others_[at_] = 0;
    }
    bin_ = bin;
  }

  double rate_;
  double bulk_share_ = kBulkShare;
  double burst_;
  double tokens_;
  Instant last_;
  std::uint64_t bin_ = 0;
  std::size_t at_ = 0;
  Bins ours_{};
  Bins others_{};
  double others_peak_ = 0.0;
};

}  // namespace maplet
