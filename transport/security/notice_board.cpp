// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/security/notice_board.hpp"

#include <algorithm>

namespace maplet {

namespace {

constexpr int kMostPauses = 16;
constexpr int kForgottenPauses = 24;  // nobody wanted it for so long

}  // namespace

NoticeBoard::NoticeBoard(Duration pause, Arena& arena)
    : places_{arena.make_array<Place>(KeyNotice::kMaxParts, "security/notices")},
      pause_{pause},
      patience_{pause} {}

bool NoticeBoard::holds(std::uint32_t generation, std::uint8_t part) const noexcept {
  return generation == generation_ && part < parts_ && places_[part].size > 0;
}

bool NoticeBoard::put(const KeyNotice& notice, std::span<const std::byte> bytes,
                      Instant now) noexcept {
  if (notice.generation < generation_ || holds(notice.generation, notice.part)) return false;
  if (notice.generation > generation_ || notice.parts != parts_) {
    generation_ = notice.generation;
    parts_ = notice.parts;
    waiting_ = 0;
    for (Place& place : places_) place.size = 0;
  }
  Place& place = places_[notice.part];
  place.size = std::min(bytes.size(), place.bytes.size());
  std::copy_n(bytes.begin(), place.size, place.bytes.begin());
  ++changes_;
  waiting_ |= std::uint64_t{1} << notice.part;
  patience_ = pause_;
  at_ = now;
  return true;
}

void NoticeBoard::wanted(std::uint16_t agent, Instant now) noexcept {
  if (parts_ == 0) return;
  if (now - said_at_ > kForgottenPauses * pause_) patience_ = pause_;
  for (std::size_t i = 0; i < parts_; ++i) {
    if (part(i).empty()) continue;
    const bool was = waiting_ != 0;
    waiting_ |= std::uint64_t{1} << i;
    if (!was) at_ = std::max(now, said_at_ + patience_);
    if (parts_ == 1) continue;
    if (const auto notice = read_key_notice(part(i)); notice && notice->find(agent)) first_ = i;
  }
}

std::span<const std::byte> NoticeBoard::next(Instant now) noexcept {
  if (waiting_ == 0 || now < at_) return {};
  while ((waiting_ >> first_ & 1) == 0) first_ = (first_ + 1) % KeyNotice::kMaxParts;
  waiting_ &= ~(std::uint64_t{1} << first_);
  if (waiting_ == 0) patience_ = std::min(2 * patience_, kMostPauses * pause_);
  said_at_ = now;
  at_ = now + pause_;
  ++sent_;
  return part(first_);
}

}  // namespace maplet
