// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/autopilot_link.hpp"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>

namespace maplet::daemon {

namespace {

constexpr Duration kRetry = std::chrono::seconds{1};  // to make a socket

}  // namespace

AutopilotLink::AutopilotLink(const AutopilotConfig& config, How how)
    : how_{how},
      to_{DatagramAddress::parse(config.destination).value_or(DatagramAddress{})},
      rate_{config.rate_hz} {}

AutopilotLink::~AutopilotLink() {
  if (socket_ >= 0) close(socket_);
}

bool AutopilotLink::open(Instant now) noexcept {
  if (socket_ >= 0) return true;
  if (tried_ != Instant{} && now - tried_ < kRetry) return false;
  tried_ = now;
  const int family = to_.address.ss_family;
  const int made = socket(family, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  // Connected, the kernel says when nobody is there. A Unix socket's owner may make it anew.
  const auto* to = reinterpret_cast<const sockaddr*>(&to_.address);
  if (made < 0 || (family != AF_UNIX && connect(made, to, to_.size) != 0)) {
    note(errno);
    if (made >= 0) close(made);
    return false;
  }
  socket_ = made;
  return true;
}

void AutopilotLink::note(int error) noexcept {
  error_.store(error, std::memory_order_relaxed);
  (error == 0 ? sent_ : failed_).fetch_add(1, std::memory_order_relaxed);
}

void AutopilotLink::send(const PoseReport& report, Instant now) noexcept {
  if (!rate_.pass(now)) return;
  AutopilotRecord record;
  record.frame = how_.frame;
  record.flags = static_cast<std::uint8_t>((report.tracking ? AutopilotRecord::kTracking : 0) |
                                           (report.partly_free ? AutopilotRecord::kPartlyFree : 0) |
                                           (report.moves ? AutopilotRecord::kMoves : 0) |
                                           (how_.system_clock ? AutopilotRecord::kSystemClock : 0));
  record.reset_counter = static_cast<std::uint8_t>(report.resets);
  record.agent = how_.agent;
  record.sequence = sequence_++;
  record.stamp_ns = report.stamp_ns;
  record.age_us = static_cast<std::uint32_t>(
      std::clamp<Duration::rep>((now - report.came).count() / 1000, 0, 0xFFFF'FFFF));
  record.map_jumps = static_cast<std::uint32_t>(report.map_jumps);
  record.pose = how_.frame == OutputFrame::kCamera   ? report.inside
                : how_.frame == OutputFrame::kNedFrd ? to_ned_frd(report.enu_flu)
                                                     : report.enu_flu;
  if (!open(now)) return;
  const AutopilotBytes bytes = to_bytes(record);
  const bool connected = to_.address.ss_family != AF_UNIX;
  const auto* to = connected ? nullptr : reinterpret_cast<const sockaddr*>(&to_.address);
  const ssize_t done = sendto(socket_, bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL, to,
                              connected ? 0 : to_.size);
  note(done < 0 ? errno : 0);
  const bool passes =
      done >= 0 || errno == ECONNREFUSED || errno == EAGAIN || errno == ENOENT || errno == ENOBUFS;
  if (passes) return;
  close(socket_);  // its interface may be another one by now
  socket_ = -1;
}

AutopilotLink::Status AutopilotLink::status() const noexcept { return {sent_, failed_, error_}; }

}  // namespace maplet::daemon
