// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/flight/event_reader.hpp"

#include <algorithm>

#include "drivers/flight/depth_code.hpp"

namespace maplet::flight {

bool EventReader::fill() noexcept {
  if (damaged_) return false;
  while (at_ + kEventHead > events_.size()) {
    const RingReader::Entry* entry = ring_->next();
    if (entry == nullptr) return false;
    at_ = 0;
    events_.clear();
    if (entry->type != Block::kEvents) continue;  // pixels of a frame that nobody asked for
    if (!ring_->read(*entry, events_)) {
      events_.clear();
      damaged_ = true;
      return false;
    }
  }
  return true;
}

Event EventReader::peek() noexcept { return fill() ? static_cast<Event>(events_[at_]) : Event{}; }

std::span<const std::byte> EventReader::body() noexcept {
  if (!fill()) return {};
  const auto size = std::to_integer<std::size_t>(events_[at_ + 1]) |
                    std::to_integer<std::size_t>(events_[at_ + 2]) << 8;
  return std::span<const std::byte>{events_}.subspan(
      at_ + kEventHead, std::min(size, events_.size() - at_ - kEventHead));
}

void EventReader::pass() noexcept {
  at_ += kEventHead + body().size();
  ++passed_;
}

bool EventReader::over() noexcept {
  const Event next = peek();
  return next == Event{} || next == Event::kStop;
}

void EventReader::keep_going() noexcept {
  if (over()) return;
  if (passed_ == passed_before_) pass();
  passed_before_ = passed_;
}

bool EventReader::read_block(Block type, std::vector<std::byte>& out) noexcept {
  const RingReader::Entry* entry = ring_->next();
  return entry != nullptr && entry->type == type && ring_->read(*entry, out);
}

bool EventReader::read_pixels(FrameNumbers& numbers) noexcept {
  DepthFrame& frame = numbers.frame;
  if (!sane(numbers, most_) || !read_block(Block::kDepth, block_)) return false;
  depth_.resize(static_cast<std::size_t>(frame.depth.width_px) *
                static_cast<std::size_t>(frame.depth.height_px));
  if (!decode_depth(block_, depth_)) return false;
  frame.depth.pixels = depth_.data();
  frame.depth.stride_px = frame.depth.width_px;
  if (!numbers.gray && !numbers.beside) return true;
  ImageView<std::uint8_t>& gray = numbers.gray ? frame.gray : frame.gray_beside.pixels;
  if (numbers.gray) gray = {nullptr, frame.depth.width_px, frame.depth.height_px, 0};
  if (!read_block(Block::kGray, gray_) ||
      gray_.size() != static_cast<std::size_t>(gray.width_px) *
                          static_cast<std::size_t>(std::max(gray.height_px, 0))) {
    return false;
  }
  gray.pixels = reinterpret_cast<const std::uint8_t*>(gray_.data());
  gray.stride_px = gray.width_px;
  return true;
}

Expected<DepthFrame> EventReader::frame() noexcept {
  while (peek() != Event::kFrame) {
    if (over()) return fail(ErrorCode::kEnd, "the record is over");
    std::uint8_t code = static_cast<std::uint8_t>(ErrorCode::kTimeout);
    const bool none = peek() == Event::kNoFrame;
    (void)look(Event::kNoFrame, code);
    pass();
    if (none) return fail(static_cast<ErrorCode>(code), "as it was");
  }
  std::array<std::byte, kMostBody> bytes{};
  const auto recorded = body().first(std::min(body().size(), bytes.size()));
  std::ranges::copy(recorded, bytes.begin());
  Body numbers_in{std::span{bytes}.first(recorded.size())};
  pass();
  FrameNumbers numbers;
  visit(numbers_in, numbers, false);
  if (!numbers_in.good() || !read_pixels(numbers)) {
    damaged_ = true;
    return fail(ErrorCode::kEnd, "the record is damaged");
  }
  return numbers.frame;
}

}  // namespace maplet::flight
